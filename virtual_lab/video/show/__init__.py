"""Tracks, bats and calibrations as text, pictures and films."""
