"""
A ball passes three light boards
================================

A ball flies through three light boards to the bat. Each board has 34
horizontal light beams, 8 mm apart. Each bar is the time for which the ball
blocks one beam. The vertical middle of the bars is the height of the ball. Its
speed follows from the delays between the boards (not shown).
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

session = vl.certify("ea70", procedure="bbcor", seed=7).certification.session
# inbound: board, beam, edge
times = 1e6 * session.records["impact"]["gates"].times[0, 0]
figure, panels = plt.subplots(1, 3, sharey=True, figsize=(4.8, 3.2))
for board, axes in enumerate(panels):
    broke, cleared = times[board].T
    seen = np.flatnonzero(np.isfinite(broke) & np.isfinite(cleared))
    start = broke[seen].min()
    dark = cleared[seen] - broke[seen]
    axes.barh(seen, dark, left=broke[seen] - start, height=0.7)
    axes.set(title=f"board {board + 1}")
panels[0].set(ylabel="beam number from the bottom")
text = "time since the first blocked beam of each board, µs"
figure.supxlabel(text, fontsize=10.5)
