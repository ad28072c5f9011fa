"""The camera of a rig: image windows of each shot, and flights from camera and gates."""
