"""A plain ball: an opaque disc that moves, fitted to its pixels at the Cramér-Rao bound."""
