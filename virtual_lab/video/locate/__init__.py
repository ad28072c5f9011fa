"""Where the ball is in each region: in a hurry by rays, or by whichever fit is its."""
