"""Layout of the block of numbers of `batch_kernel`: start of each row, which has one per lane.

Numba compiles a number of a module faster than a field of a tuple, which it would build at each use
of a field.
"""

from __future__ import annotations

LANES = 64
ROW = LANES + 8  # distance of rows: whole cache lines, but not a power of two

s, s_rate, x, rate, bend, jerk, old_rate, old_bend = range(0, 8 * ROW, ROW)
force, u, u_share, log_k, power, c, compliance, time = range(8 * ROW, 16 * ROW, ROW)
h, h_mode, h_grown, ball, event, steps, scene, phase = range(16 * ROW, 24 * ROW, ROW)
peak, near, turned, reach, loss, softness = range(24 * ROW, 30 * ROW, ROW)
head = 30 * ROW  # first row of the modes, which are last
