"""Stations of the rigs: their protocol, their common base, their flights and their collisions."""
