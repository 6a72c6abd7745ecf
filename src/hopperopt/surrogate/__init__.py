"""The surrogate: from the simulated outflow curves to a network that predicts them for any design."""
