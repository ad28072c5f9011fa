"""
A ball to hundredths of a pixel
===============================

A simulated camera frame of a stitched ball, and the outline fitted to its rim. The fitted center
(cross) is within three hundredths of a pixel of the true center (dot).
"""

import matplotlib.pyplot as plt

from virtual_lab.fidelity.camera_pictures import pictures
from virtual_lab.fidelity.camera_scenes import Case
from virtual_lab.video.locate.edge_fit import fit_edge

batch = pictures(Case(radius=20, stitched=True, light="soft", phases=1, repeats=1))
given = batch.inputs
ball = fit_edge(given.regions, given.start, noise=given.noise, lens=given.lens)
(left, top), (x, y) = given.regions.corners[0], ball.places[0]
figure, axes = plt.subplots(subplot_kw={"xlabel": "column, px", "ylabel": "row, px"})
axes.imshow(given.regions.pixels[0], cmap="gray", zorder=2)
axes.add_patch(plt.Circle((x - left, y - top), ball.radius[0], fill=False, color="C1", zorder=3))
axes.plot(x - left, y - top, "+", color="C0", markersize=14, label="fitted center")
axes.plot(batch.x - left, batch.y - top, ".", color="C5", label="true center")
axes.set_title(f"error {abs(complex(x - batch.x[0], y - batch.y[0])):.3f} px")
axes.legend(labelcolor="white")
