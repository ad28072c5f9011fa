"""What a command begins: a day that is served, one that an operator takes, a class reviewed."""
