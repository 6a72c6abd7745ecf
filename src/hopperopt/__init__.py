"""Optimisation of a hopper insert against size segregation: simulation, surrogate, optimiser, verification."""
