"""Clips as users film them, rendered by a program that shares no code with the package.

`made = film(SCENES["thrown-on-wall"], folder)` writes the clip `made.path`; `made.truth` holds the
ball's position and phase in each frame, its flights and its contacts. `dataclasses.replace` derives
scenes from a named one. `make_shot(kind, seed)` in `shots` renders for a high-speed camera.
"""
