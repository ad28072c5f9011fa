"""The pymunk space of one shot: ball, bat and what stands around them, seen from above."""

from __future__ import annotations

from typing import Any

import numpy as np

from virtual_lab.simulation.motion.scene import Obstacle, Scene
from virtual_lab.simulation.motion.settings import Settings

__all__ = ["Space"]

BALL = 1  # its category: it alone meets what stands
Point = tuple[float, float]


class Space:
    """A pymunk space in SI, pymunk's x and y being x and z of the scene; no gravity.

    The bat is a body whose centre lies on its axis and whose moment is that about the axis: its
    joint does no work, whatever the step. Ball and bat never collide here.
    """

    def __init__(self, scene: Scene, settings: Settings) -> None:
        import pymunk

        space = pymunk.Space()
        space.iterations, space.gravity = settings.iterations, (0.0, 0.0)
        space.collision_slop, space.collision_bias = settings.slop, settings.bias
        self.ball = pymunk.Body(float(scene.balls.mass[0]), float("inf"))
        self.radius = scene.balls.radius
        circle = pymunk.Circle(self.ball, self.radius)
        circle.elasticity = 1.0  # pymunk multiplies: the obstacle's own stands
        circle.filter = pymunk.ShapeFilter(categories=BALL)
        self.bat = pymunk.Body(1.0, scene.bat.inertia)  # with its centre held, any mass will do
        self.pivot = (0.0, scene.bat.axis)
        self.bat.position = self.pivot
        joint = pymunk.PivotJoint(space.static_body, self.bat, self.pivot)
        space.add(self.ball, circle, self.bat, joint)
        self.solids = [(*self._stand(space, one), one) for one in scene.obstacles]
        space.on_collision(pre_solve=self._pass_others)
        self.space, self.striking = space, None

    @staticmethod
    def _stand(space: Any, obstacle: Obstacle) -> tuple[Any, list[Any]]:
        """Return the shape of an obstacle and those to be asked for a ball that comes to it."""
        import pymunk

        first, last = zip(obstacle.x, obstacle.z, strict=True)
        body, radius = space.static_body, obstacle.radius
        ends = [pymunk.Circle(body, radius, end) for end in (first, last)]
        # a segment of no length has no normal
        solid: Any = ends[0] if first == last else pymunk.Segment(body, first, last, radius)
        # a segment that is asked overlooks its round ends from beside itself: they are asked too
        asked = [solid] if first == last else [solid, *ends]
        solid.elasticity = obstacle.restitution
        for shape in asked:
            shape.filter = pymunk.ShapeFilter(mask=BALL if shape is solid else 0)
        space.add(*asked)
        return solid, asked

    def carry(
        self, place: Point, velocity: Point, angle: float, rate: float, span: float, solid: Any
    ) -> None:
        """Move ball and bat from a place and an angle for `span` [s].

        Of all shapes the ball strikes `solid` alone: it flies over what is low.
        """
        self.striking = solid
        self.ball.position, self.ball.velocity = place, velocity
        self.bat.angle, self.bat.angular_velocity = angle, rate
        self.space.step(span)

    def _pass_others(self, arbiter: Any, _space: Any, _data: Any) -> None:
        arbiter.process_collision = self.striking in arbiter.shapes

    @property
    def drift(self) -> float:
        """How far the bat is off its axis [m]."""
        place = self.bat.position
        return float(np.hypot(place.x - self.pivot[0], place.y - self.pivot[1]))

    def ahead(self, here: Point, there: Point) -> list[tuple[float, Any, Obstacle]]:
        """Return the share of the way at which the ball touches a shape, that, and what it is.

        Sorted, and only shapes it comes closer to. Shape by shape: asked as a whole, pymunk's
        space looks for the ball's centre alone.
        """
        found = []
        way = there[0] - here[0], there[1] - here[1]
        for solid, asked, obstacle in self.solids:
            for shape in asked:
                hit = shape.segment_query(here, there, self.radius)
                if hit and hit.shape and hit.normal.dot(way) < 0:
                    found.append((float(hit.alpha), solid, obstacle))
        return sorted(found, key=lambda one: one[0])

    def within(self, depth: float) -> list[Obstacle]:
        """Return what the ball overlaps in the plan by more than `depth` [m]."""
        near = self.radius - depth
        place = self.ball.position
        return [one for solid, _, one in self.solids if solid.point_query(place).distance < near]
