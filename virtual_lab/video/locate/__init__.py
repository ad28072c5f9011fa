"""Positions of the ball in regions of frames, by a fit of its outline."""
