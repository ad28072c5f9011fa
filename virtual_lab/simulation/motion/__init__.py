"""The motion of ball and bat around their collision: in closed form, or carried by pymunk."""
