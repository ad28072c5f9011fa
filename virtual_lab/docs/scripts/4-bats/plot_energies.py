"""
Where the energy goes
=====================

Shares of the ball's energy after it hits a free wood bat at rest. Bending is least near the nodes
of the first two modes, where e is greatest; half of the energy is lost in the ball.
"""

import matplotlib.pyplot as plt
import numpy as np

from virtual_lab.catalog import load
from virtual_lab.catalog.specs import BallSpec, BatSpec
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.beam import Free

place, ball = np.arange(2, 12.1, 0.1), load("balls", "baseball-2003", BallSpec).spec
bat = ModalModel.of(load("bats", "r161", BatSpec).spec.body, Free())
hits = Scenes.with_ball(ball, impact_position=place * 0.0254, relative_speed=60)
energy, (figure, axes) = bat.collide(hits).energy, plt.subplots()
for name in ("hysteresis", "rigid", "bending", "ball"):
    axes.plot(place, 100 * getattr(energy, name), label=name)
axes.set(xlabel="impact position from the tip, in", ylabel="share of the energy, %", ylim=(0, 80))
axes.legend(ncols=2)
