"""All claims of the paper, in order, and the functions that compute our results."""

from __future__ import annotations

from pathlib import Path

from tests.studies.paper import computed, examples, metrics, models, procedures
from tests.studies.paper.claim import Claim, read_claims

PATH = Path(__file__).with_suffix(".csv")
FINDERS = {
    name: finder
    for section in (computed, metrics, models, examples, procedures)
    for name, finder in vars(section).items()
    if callable(finder) and finder.__module__ == section.__name__
}
CLAIMS: tuple[Claim, ...] = (*read_claims(PATH, FINDERS), *examples.table_one())
