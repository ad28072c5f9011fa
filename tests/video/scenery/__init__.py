"""Clips as users film them, rendered by a program that shares no code with the package.

`film(SCENES["thrown-on-wall"], folder)` writes a clip and returns what is true of it.
"""
