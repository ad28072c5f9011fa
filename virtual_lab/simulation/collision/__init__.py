"""The collision of ball and bat: a ladder of models, from the fastest to the most accurate."""
