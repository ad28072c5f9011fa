"""The twin of a laboratory: its day played again with what its own records state."""
