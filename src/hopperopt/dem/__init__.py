"""Discrete element method: spheres and walls of revolution (numpy and numba only)."""
