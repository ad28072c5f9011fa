"""The machines of the laboratory, which write the readings of each action and know the truth."""
