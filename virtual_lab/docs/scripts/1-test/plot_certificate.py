"""
The hits of a certificate
=========================

Six valid hits of a pivoted wood bat scatter about their mean, which is the
result. The band is the 95 % interval of the result. It is far below the
limit, and the bat passes.
"""

import matplotlib.pyplot as plt

import virtual_lab as vl

test = vl.certify("r161", procedure="astm-f1881", seed=7)
figure, axes = plt.subplots()
shot, factor = test.shots["shot"] + 1, test.shots["bat_performance_factor"]
axes.plot(shot, factor, "o", label="valid hit")
axes.axhspan(*test.interval, color="0.85", label="95 % interval of the result")
axes.axhline(test.value, label="result")
limit = test.document["metric"]["limit"]
axes.axhline(limit, color="k", linestyle="--", label="limit of ASTM F1881")
axes.set(xlabel="shot number", ylabel="bat performance factor")
axes.set_ylim(0.85, 1.35)
axes.legend(ncols=2)
