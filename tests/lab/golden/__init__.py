"""Results of the loop over laboratories, row by row: the oracle of its replacement."""
