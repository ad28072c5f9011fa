"""Entry points of the commands: a served day, an operator's day, the review of a class."""
