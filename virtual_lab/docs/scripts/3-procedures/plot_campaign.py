"""
A campaign read by SQL
======================

Errors of 2 000 simulated BBCOR tests of R161, divided by their stated standard
uncertainty u, read from Parquet files by SQL. Of the errors, 7 % exceed 2 u in
magnitude (normal distribution: 5 %).
"""

from tempfile import mkdtemp

import duckdb
import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import norm

import virtual_lab as vl

study = {"bats": ["r161"], "procedures": ["bbcor"]}
study |= {"laboratories": 2000, "seed": 1}
vl.campaign(study, folder := mkdtemp() + "/tests")
query = f"select (value - true_value) / u as z from '{folder}/parts/*.parquet'"
z = duckdb.sql(query).fetchnumpy()["z"]
figure, axes = plt.subplots()
bins, x = np.arange(-4, 4.1, 0.5), np.linspace(-4, 4, 200)
axes.hist(z, bins, density=True, color="0.75", edgecolor="white")
axes.plot(x, norm.pdf(x), color="C1", label="normal\ndistribution")
axes.set(xlabel="error / u", ylabel="probability density")
axes.legend(loc="upper left", fontsize=8.5)
