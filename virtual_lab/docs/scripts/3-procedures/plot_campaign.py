"""
A campaign read by SQL
======================

Errors of two thousand tests in Parquet files, in u. The line is what the stated u promises.
"""

from tempfile import mkdtemp

import duckdb
import matplotlib.pyplot as plt
import numpy as np
from scipy.stats import norm

import virtual_lab as vl

study = {"bats": ["r161"], "procedures": ["bbcor"], "laboratories": 2000, "seed": 1}
vl.campaign(study, folder := mkdtemp() + "/tests")
query = f"select (value - \"true\") / u as z from '{folder}/parts/*.parquet'"
z = duckdb.sql(query).fetchnumpy()["z"]
figure, axes = plt.subplots()
axes.hist(z, np.arange(-4, 4.1, 0.5), density=True, color="0.75", edgecolor="white")
axes.plot(x := np.linspace(-4, 4, 200), norm.pdf(x), color="C1", label="u as stated")
axes.set(xlabel="error, in u", ylabel="share of tests per u")
axes.legend()
