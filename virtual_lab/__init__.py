"""A simulated laboratory that certifies baseball bats and works like a real one.

>>> import virtual_lab as vl
>>> certificate = vl.certify("r161", procedure="astm-f1881", seed=7)
>>> certificate.verdict
'PASS'

``help(vl.certify)`` describes a function with its arguments. Wherever a function takes the name of
a bat, ball or procedure it also takes the path of a .toml file or a sheet, such as
``vl.procedure("bbcor")``. Results of tests and studies have ``.text``, ``.document`` (for JSON) and
``.save(folder)``, and most of them ``.table`` (pandas) and ``.plot()``. A function that takes more
than two seconds shows its progress on stderr; with ``progress=lambda *_: None`` it shows none.

Test a bat
    certify          test a bat by a procedure, and make its certificate
    load             read the certificate of a result folder
    reduce           compute a certificate from raw records alone
    score            compare a certificate with the true values
    verify           repeat the reduction of a result folder, and list differences
    report           compare the certificates in result folders
    template         write empty record forms for another laboratory
    rehearse         let an operator carry out a day at the rehearsal bench

Bats and the catalog
    shelf            list of bats, balls, procedures, instruments, rigs, faults
    show             show an entry, every number with unit and source
    bat              data sheet of a bat, whose values can be changed
    ball             data sheet of a ball
    procedure        data sheet of a test procedure
    instrument       data sheet of an instrument
    rig              data sheet of a rig
    profile          e, r, e_A and v_f along the barrel; comparison of bats
    fit_bat          make a bat that fits measurements
    sensitivity      effect of the ball's force law on the results of a bat
    slope            slope of e_A along the barrel

Studies of laboratories and procedures
    sweep            test bats in many laboratories: a table, one row per test
    campaign         test bats in very many laboratories, into Parquet files
    coverage         share of 95 % intervals that contain the true value
    operating        probability that a bat passes, by its true metric
    interlab         repeatability, reproducibility, and their causes
    bias             systematic error of the method, without randomness
    faults           detection and bias of faults, beside predictions
    plan             hits, balls and instruments that reach a target u
    laboratory       data sheets of a laboratory from its own records
    twin             simulate a laboratory's day again, and check its uncertainty
    critique         ranking of bats by procedures, compared with the field
    daily            control charts of the daily checks

Uncertainty and decisions, of any model and data
    Input            an input of a model: value and u, or limits
    propagate        uncertainty of a function's result
    conformity       probability that an item conforms (JCGM 106, 7)
    guard_band       guard band and acceptance limits
    risk             consumer's and producer's risks (JCGM 106, 9)
    nested_study     variances within and between laboratories and lots

Camera
    track            follow the ball through a video clip
    calibrate        calibrate a camera with pictures of a board
    board            simulate pictures of a board, to try calibrate

Speed and accuracy
    chart            error and run time of models and methods
    stability        conditions under which the numerical methods are valid

Classes of results, sheets and errors
    Certificate      result of certify, load and reduce
    Track            result of track
    Calibration      result of calibrate
    Campaign         result of campaign
    BatProfile       result of profile for one bat
    BatComparison    result of profile for several bats
    Sheet            result of bat, ball, procedure, instrument and rig
    InputError       input that cannot be used, with what is allowed
    IncompleteError  a result that was saved without some of its forms
"""

import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

# The matrices of this program are small: threads within one product only wait for one another,
# which takes processor time. The variables are read when numpy is loaded. A value that the user has
# set is not changed.
if "OMP_NUM_THREADS" not in os.environ:
    for variable in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
        os.environ.setdefault(variable, "1")

from virtual_lab import api
from virtual_lab.errors import VERSION
from virtual_lab.files.caches import provide_cache

provide_cache(Path(__file__).parent)  # before numba is loaded, which reads the setting

if TYPE_CHECKING:
    from virtual_lab.api import *  # noqa: F403

__version__ = VERSION

if "IPython" in sys.modules and (shell := sys.modules["IPython"].get_ipython()):
    from virtual_lab.api.completing import complete_in

    complete_in(shell)


# There is no `__all__`, because pydoc would describe every name in it, and help(vl) would be more
# than the text above.
def __dir__() -> list[str]:
    return sorted(["__version__", *api.PLACES])


if not TYPE_CHECKING:  # a type checker would accept any name as an attribute

    def __getattr__(name: str) -> Any:
        """Load an attribute at its first use."""
        if name not in api.PLACES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        globals()[name] = getattr(api, name)
        return globals()[name]
