"""Nominal data: bats, balls, procedures, instruments and rigs, every number with its source."""
