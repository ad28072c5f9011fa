"""Uncertainty of what reduction gives: budgets, intervals, coverage factors."""
