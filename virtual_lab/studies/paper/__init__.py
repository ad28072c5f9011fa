"""Every number, figure and claim of the paper beside what this library computes of it."""

from virtual_lab.studies.paper.claim import Claim, Row
from virtual_lab.studies.paper.findings import CLAIMS, Findings, paper

__all__ = ["CLAIMS", "Claim", "Findings", "Row", "paper"]
