"""Speed against accuracy: run time and error of each model and method."""
