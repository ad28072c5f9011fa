"""From raw records and calibrations to measured values; never from the truth."""
