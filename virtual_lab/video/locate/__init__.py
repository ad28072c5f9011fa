"""Places of the ball in regions of frames, by the fit of its outline."""
