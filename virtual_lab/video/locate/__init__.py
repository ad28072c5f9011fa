"""Where the ball is in each region, by the fit of its outline."""
