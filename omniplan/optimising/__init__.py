"""Optimising: trajectories made faster, smoother or permitted by a solver."""
