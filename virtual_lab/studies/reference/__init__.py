"""Published measurements of bats, balls and tests beside the results of this laboratory."""
