"""
Bats along the barrel
=====================

Speed of the batted ball in the standard game, over the impact position. The aluminium bat is
faster, and its best place is as far from the tip as that of the wood bat.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

table = vl.profile(["r161", "ea70"], swings=[0.3]).table
figure, axes = plt.subplots()
names = {"r161": "R161, wood", "ea70": "EA70, aluminium"}
for bat, rows in table[table["impact_position_in"].between(2, 12)].groupby("bat", sort=False):
    axes.plot(rows["impact_position_in"], rows["batted_speed_mph"], label=names[bat])
axes.set(xlabel="impact position from the tip, in", ylabel="batted-ball speed, mph")
axes.legend()
