"""
A ball to hundredths of a pixel
===============================

A camera frame of a stitched ball, and the outline that is fitted to its rim. The cross is the
fitted centre, the circle the true one: they differ by less than the width of a line.
"""

import matplotlib.pyplot as plt

from virtual_lab.fidelity.camera_pictures import pictures
from virtual_lab.fidelity.camera_scenes import Case
from virtual_lab.video.locate.edge_fit import fit_edge

batch = pictures(Case(radius=20, stitched=True, light="soft", phases=1, repeats=1))
given = batch.inputs
ball = fit_edge(given.regions, given.start, noise=given.noise, lens=given.lens)
(left, top), (x, y) = given.regions.corners[0], ball.places[0]
figure, axes = plt.subplots()
axes.imshow(given.regions.pixels[0], cmap="gray", zorder=2)
axes.add_patch(plt.Circle((x - left, y - top), ball.radius[0], fill=False, color="C1", zorder=3))
axes.plot(x - left, y - top, "+", color="C0", markersize=14, label="fitted")
axes.plot(batch.x - left, batch.y - top, "o", mfc="none", color="C5", markersize=9, label="true")
axes.set(xlabel="column, px", ylabel="row, px")
axes.legend(labelcolor="white")
