"""Motion of ball and bat before and after the collision: closed form, events or pymunk."""
