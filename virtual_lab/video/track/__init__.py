"""A ball found in frames, linked into flights, and what these say of its speeds."""
