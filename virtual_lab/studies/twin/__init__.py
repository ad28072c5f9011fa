"""The twin of a laboratory: its day simulated again, as its own records state it."""
