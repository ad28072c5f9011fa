"""
A ball to hundredths of a pixel
===============================

Left: a simulated camera frame of a ball, with the outline fitted to its rim
(dashed). Right: its center, enlarged. The fitted center is within three
hundredths of a pixel of the true center.
"""

import matplotlib.pyplot as plt

from virtual_lab.fidelity.camera_pictures import pictures
from virtual_lab.fidelity.camera_scenes import Case
from virtual_lab.video.locate.edge_fit import fit_edge

case = Case(radius=20, stitched=True, light="soft", phases=1, repeats=1)
batch = pictures(case)
given = batch.inputs
ball = fit_edge(given.regions, given.start, noise=given.noise, lens=given.lens)
left, top = given.regions.corners[0]
x, y = ball.places[0] - (left, top)
figure, (axes, zoom) = plt.subplots(1, 2, figsize=(5.4, 2.7))
axes.imshow(given.regions.pixels[0], cmap="gray", zorder=2)
rim = {"fill": False, "ec": "C1", "lw": 3, "ls": "--", "zorder": 3}
axes.add_patch(plt.Circle((x, y), ball.radius[0], **rim))
axes.set(xlabel="column, px", ylabel="row, px")
zoom.plot(x, y, "k+", batch.x - left, batch.y - top, "C1o", markersize=9)
zoom.set(xlabel="column, px", ylabel="row, px", aspect=1)
zoom.set(xlim=(x - 0.1, x + 0.1), ylim=(y + 0.1, y - 0.1))
zoom.legend(["fitted center", "true center"])
