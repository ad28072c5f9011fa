"""The commands' own side: a day served, one that an operator takes, the review of a class."""
