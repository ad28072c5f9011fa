"""Web pages on this computer: who may see them, what serves them, and what all pages share."""
