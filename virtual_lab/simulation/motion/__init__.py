"""Motion of ball and bat before and after the collision, in closed form, by events or by pymunk."""
