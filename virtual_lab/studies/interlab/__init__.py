"""A test procedure in several laboratories: predicted and simulated precision."""
