"""Clips read from files: frames one at a time, their times, and the calibration of the camera."""
