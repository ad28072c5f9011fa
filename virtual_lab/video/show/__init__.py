"""Tracks and calibrations as text, pictures and films."""
