"""The simulated machines of the laboratory, which know the truth and produce the readings."""
