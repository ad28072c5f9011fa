"""Closed-form equations used by both the simulation and the measurement side."""
