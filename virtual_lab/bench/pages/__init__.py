"""The pages, made of a day alone."""
