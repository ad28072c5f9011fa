"""One test: the only place where rigs, reduction and procedure meet."""

from virtual_lab.lab.campaign import Campaign
from virtual_lab.lab.certify import certify_bat, open_laboratory
from virtual_lab.lab.curvature import curvatures
from virtual_lab.lab.laboratory import Tested

__all__ = ["Campaign", "Tested", "certify_bat", "curvatures", "open_laboratory"]
