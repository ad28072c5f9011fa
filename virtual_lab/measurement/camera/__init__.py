"""The camera of a rig: the windows of each shot, and flights with what the gates know."""
