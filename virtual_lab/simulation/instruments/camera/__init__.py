"""A high-speed camera: from true paths of ball and bat to regions, frames and films.

Pixels are those of OpenCV: (0, 0) is the center of the first pixel, x is to the right, y down. Axes
of the camera: x to the right, y down, z away from it. Light is measured in photoelectrons until
`sensor` converts it to gray values.
"""
