"""Measurements to run by hand, on one core. None of them is a test."""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one thread; numpy reads it when it loads
