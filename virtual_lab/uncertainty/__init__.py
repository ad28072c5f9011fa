"""Uncertainty of reduced results: budgets, intervals, coverage factors."""
