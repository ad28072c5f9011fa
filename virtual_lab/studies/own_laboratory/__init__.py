"""Data sheets of a laboratory, made from its own records."""
