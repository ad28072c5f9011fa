"""The collision of ball and bat: a ladder of models, cheap to dear."""
