"""A high-speed camera: from true paths of ball and bat to regions, frames and films.

Pixels are OpenCV's: (0, 0) is the centre of the first pixel, x right, y down. Axes of the
camera: x right, y down, z away from it. Light counts in photoelectrons until `sensor` makes
grey values of it.
"""
