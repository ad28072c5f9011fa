"""One test: the only place where rigs, reduction and procedure meet."""

from virtual_lab.lab.laboratory import Tested, certify_bat

__all__ = ["Tested", "certify_bat"]
