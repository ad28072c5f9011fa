"""Every number, figure and claim of the paper, compared with results of this library."""

from virtual_lab.studies.paper.claim import Claim, Row
from virtual_lab.studies.paper.findings import CLAIMS, Findings, paper

__all__ = ["CLAIMS", "Claim", "Findings", "Row", "paper"]
