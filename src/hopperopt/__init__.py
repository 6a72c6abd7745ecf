"""Optimisation of a hopper insert against segregation: simulation, surrogate, optimiser, verification."""
