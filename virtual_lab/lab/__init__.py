"""One test, through both sides: rigs write records, the reduction reads them."""

from virtual_lab.lab.campaign import Campaign
from virtual_lab.lab.certify import certify_bat
from virtual_lab.lab.curvature import curvatures
from virtual_lab.lab.laboratory import Laboratory
from virtual_lab.lab.rehearsal import Rehearsal, Straying
from virtual_lab.lab.setup import TestSetup
from virtual_lab.lab.test_day import TestDay, Tested, by_the_book, prepared

__all__ = [
    "Campaign",
    "Laboratory",
    "Rehearsal",
    "Straying",
    "TestDay",
    "TestSetup",
    "Tested",
    "by_the_book",
    "certify_bat",
    "curvatures",
    "prepared",
]
