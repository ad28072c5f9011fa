"""Lens, pose and scale of a camera from pictures of a board, and conversion of pixels to meters."""
