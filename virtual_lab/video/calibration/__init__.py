"""A camera's lens, pose and scale from pictures of a board; from pixels to metres."""
