"""
An encoder record and its fit
=============================

Above: the encoder at the pivot measures the angle of the bat, which recoils
after the hit (1 count is 0.036°). Below: the record minus a smooth cubic fit
shows that the bat vibrates. The amplitude falls from about 20 counts to 10.
The test fits recoil and vibration together.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

session = vl.certify("r161", seed=7).certification.session
record = session.records["impact"]["encoder"]
time, counts = 1e3 * record.times, record.counts[0]
turning = time > time[np.flatnonzero(counts != counts[0])[0]] + 3
smooth = np.polynomial.Polynomial.fit(time[turning], counts[turning], 3)
figure, (above, below) = plt.subplots(2, sharex=True, figsize=(4.8, 4.4))
above.plot(time, counts, label="encoder")
above.plot(time[turning], smooth(time[turning]), label="cubic fit")
above.set(ylabel="angle, counts")
above.legend()
below.plot(time[turning], counts[turning] - smooth(time[turning]))
below.set(xlabel="time, ms", ylabel="record minus fit, counts")
