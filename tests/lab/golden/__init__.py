"""What the loop over laboratories gave, row by row: the oracle of whatever takes its place."""
