"""
Hits off the center of percussion
=================================

Impulse on the axis of a pivoted R161 bat, per hit of a ball at 60 mph. A hit
at the center of percussion (dashed) puts no load on the axis. Any other hit
does, and friction then slows the bat.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl
from virtual_lab.simulation.physics.beam import beam_of

profile = vl.profile("r161").table.query("2 <= impact_position_in <= 12")
beam, ball = beam_of(vl.bat("r161").spec.body), vl.ball("baseball-2003").spec
axis, z = beam.length - 6 * 0.0254, profile["impact_position_in"] * 0.0254
percussion = beam.inertia(axis) / (beam.mass * (axis - beam.z_cm))
# impulse on the bat
blow = ball.mass * 60 * 0.44704 * (1 + profile["collision_efficiency"])
figure, axes = plt.subplots()
axes.plot(z / 0.0254, blow * (1 - (axis - z) / percussion))
axes.axhline(0, color="black", linewidth=0.8)
axes.axvline((axis - percussion) / 0.0254, color="0.6", linestyle="--")
axes.set_xlabel("impact position from the tip, in")
axes.set_ylabel("impulse on the axis, N s")
