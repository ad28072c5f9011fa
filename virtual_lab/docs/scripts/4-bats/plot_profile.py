"""
Bats along the barrel
=====================

Speed of the batted ball under standard game conditions: pitch of 90 mph (40.2
m/s), and bats swung at 69 mph (30.8 m/s; wood) and 72 mph (32.2 m/s;
aluminum), 6 in from the tip. The aluminum bat hits the ball faster from 4.5 in
on (and below 2.8 in). Its best position is 6.3 in from the tip, that of the
wood bat 5.5 in.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

table = vl.profile(["r161", "ea70"], swings=[0.3]).table
figure, axes = plt.subplots()
names = {"r161": "R161, wood", "ea70": "EA70, aluminum"}
for bat, name in names.items():
    rows = table[table["bat"] == bat].query("2 <= impact_position_in <= 12")
    axes.plot(rows["impact_position_in"], rows["batted_speed_mph"], label=name)
axes.set_xlabel("impact position from the tip, in")
axes.set_ylabel("batted-ball speed, mph (1 mph = 0.447 m/s)")
axes.legend()
