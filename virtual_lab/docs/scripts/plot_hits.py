"""
Hits
====

The six hits of a test.
"""

import virtual_lab as vl

figure = vl.certify("r161", seed=7).plot()
