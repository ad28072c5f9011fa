"""
Hits off the center of percussion
=================================

Impulse on the axis of a pivoted R161 bat, per hit of a ball at 60 mph. A hit at the center of
percussion (dashed) puts no load on the axis. Any other hit does, and friction then slows the bat.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl
from virtual_lab.simulation.physics.beam import beam_of

profile = vl.profile("r161").table.query("2 <= impact_position_in <= 12")
beam, ball, inch = beam_of(vl.bat("r161").spec.body), vl.ball("baseball-2003").spec, 0.0254
arm = beam.length - 6 * inch - profile["impact_position_in"] * inch  # from the axis
percussion = beam.inertia(beam.length - 6 * inch)
percussion /= beam.mass * (beam.length - 6 * inch - beam.z_cm)
blow = ball.mass * 60 * 0.44704 * (1 + profile["collision_efficiency"])  # impulse on the bat
figure, axes = plt.subplots()
axes.plot(profile["impact_position_in"], blow * (1 - arm / percussion))
axes.axhline(0, color="black", linewidth=0.8)
axes.axvline(beam.length / inch - 6 - percussion / inch, color="0.6", linestyle="--")
axes.set(xlabel="impact position from the tip, in", ylabel="impulse on the axis, N s")
