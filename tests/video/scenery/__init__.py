"""Clips as users film them, rendered by a program that shares no code with the package.

`made = film(SCENES["thrown-on-wall"], folder)` writes a clip: `made.path`, and in `made.truth`
each frame's place and phase, flights and contacts. `dataclasses.replace` makes other scenes of a
named one. `shots` draws the same for a high-speed camera before a bat: `make_shot(kind, seed)`.
"""
