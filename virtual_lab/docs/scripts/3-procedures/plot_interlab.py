"""
Why laboratories differ
=======================

Standard deviation of BBCOR among laboratories that test one EA70, for each
cause alone (bars) and for all (total, dashed), each ± 1 %. The squares of the
bars add up to about the square of the total. Normalizing to a standard ball
removes the effects of ball lot and humidity. It adds that of the wall at which
the ball is tested.
"""

import matplotlib.pyplot as plt
import pandas as pd

from virtual_lab.catalog.reading import DATA

table = pd.read_csv(next(DATA.parent.glob("tests/studies/interlab-2*.csv")))
table = table.query("bat == 'ea70' & procedure == 'bbcor'")
causes = {
    "lot": "ball lot\n(restitution)",
    "stiffness": "ball stiffness",
    "store": "ball humidity",
    "s_r": "repeatability",
    "calibration": "calibration",
    "wall": "wall",
}
figure, panels = plt.subplots(1, 2, sharey=True)
for axes, result in zip(panels, ["as found", "normalized"], strict=True):
    rows = table[table["result"] == result]
    spread = 1e3 * rows.set_index("term")["simulated"]
    bars = spread[list(causes)].rename(causes)
    axes.barh(bars.index, bars, hatch="//", edgecolor="white")
    axes.axvline(spread["s_R"], color="C1", linestyle="--")
    axes.set_title(f"{result}, total {spread['s_R']:.1f}")
    axes.set(xlabel="SD of BBCOR, 0.001", xlim=(0, 5))
