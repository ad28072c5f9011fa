"""High-speed video: from the frames of a clip to where the ball was and how fast it went."""
