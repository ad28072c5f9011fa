"""The motion of ball and bat around their collision: a ladder of two rungs, cheap to dear."""

from virtual_lab.simulation.motion.ladder import RUNGS, play

__all__ = ["RUNGS", "play"]
