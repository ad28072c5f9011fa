"""Plans of a laboratory that reach a target uncertainty."""
