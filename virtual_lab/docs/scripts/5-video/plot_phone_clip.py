"""
A ball in a phone's clip
========================

A simulated clip is tracked like a clip from a phone. Each dot is the ball in
one frame (none at 0.150 s, the bounce). Curves fitted to the flights before
and after the bounce (not drawn) give both speeds at the floor. Their ratio is
the restitution.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

# s; the ball touches the floor at 0 and returns at 3 m/s
t = np.arange(60) / 240 - 0.15
height = np.where(t < 0, -5.47 * t, 3 * t) - 9.81 / 2 * t**2
y, x = np.mgrid[:240, :320]
# px from the ball's center
away = np.hypot(x - 160, y - 225 + height[:, None, None] / 0.0035)
noise = np.random.default_rng(1).normal(0, 2, away.shape)
clip = (40 + 120 * np.clip(10.9 - away, 0, 1) + noise).astype(np.uint8)
track = vl.track(clip, ball="73mm±0.5mm", fps=240)
e = track.contacts["restitution"][0]
figure, axes = plt.subplots()
axes.set_title(f"restitution {e:.3f} (true: {3 / 5.47:.3f})")
axes.plot(track.places["time_s"], track.places["y_px"], "o")
axes.set(xlabel="time, s", ylabel="image row, px", ylim=axes.get_ylim()[::-1])
