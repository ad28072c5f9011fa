"""
The hits of a certificate
=========================

A wood bat in the test on a pivot. The six valid hits scatter about their mean, which is the
result; the band is its 95 % interval, far below the limit.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

test = vl.certify("r161", procedure="astm-f1881", seed=7)
figure, axes = plt.subplots()
axes.plot(test.shots["shot"], test.shots["bat_performance_factor"], "o", label="valid hit")
axes.axhspan(*test.interval, color="0.85", label="95 % interval")
axes.axhline(test.value, label="result")
axes.axhline(test.document["metric"]["limit"], color="black", linestyle="--", label="limit")
axes.set(xlabel="number of the shot", ylabel="bat performance factor", ylim=(0.85, 1.35))
axes.legend(ncols=2)
