"""The motion of ball and bat around their collision: in closed form, by events, by pymunk."""
