"""Computations on bats from their properties, without a test."""
