"""The ball of a calibrated camera: located sharply, its two flights, their speeds."""
