"""One test: the only place where rigs, reduction and procedure meet."""

from virtual_lab.lab.campaign import Campaign
from virtual_lab.lab.certify import certify_bat, open_laboratory
from virtual_lab.lab.curvature import curvatures
from virtual_lab.lab.laboratory import Tested
from virtual_lab.lab.rehearsal import Rehearsal, Straying

__all__ = [
    "Campaign",
    "Rehearsal",
    "Straying",
    "Tested",
    "certify_bat",
    "curvatures",
    "open_laboratory",
]
