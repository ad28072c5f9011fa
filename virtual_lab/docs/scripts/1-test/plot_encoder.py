"""
An encoder record and its fit
=============================

Above: the ball strikes the bat, and the encoder at the pivot counts its recoil. Below: the record
minus a smooth fit shows the bat vibrate after the hit. Its amplitude falls from 20 counts to 10.
"""

import matplotlib.pyplot as plt
import numpy as np

import virtual_lab as vl

test = vl.certify("r161", seed=7)
record = test.certification.session.records["impact"]["encoder"]
time, counts = 1e3 * record.times, record.counts[0]
turning = time > time[np.flatnonzero(counts != counts[0])[0]] + 3
smooth = np.polynomial.Polynomial.fit(time[turning], counts[turning], 3)
figure, (above, below) = plt.subplots(2, sharex=True, figsize=(4.8, 4.4))
above.plot(time, counts, label="encoder")
above.plot(time[turning], smooth(time[turning]), label="smooth fit")
above.set(ylabel="counts")
above.legend()
below.plot(time[turning], counts[turning] - smooth(time[turning]))
below.set(xlabel="time, ms", ylabel="record minus fit, counts")
