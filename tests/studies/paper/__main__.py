"""Print the claims of the paper beside our results, the reasons of those lost, and the count."""

from __future__ import annotations

from tests.studies.paper.claims import CLAIMS
from virtual_lab.output.tables import table_text

rows = [claim.row() for claim in CLAIMS]
print(table_text([row.cells for row in rows]), end="\n\n")
print(f"{sum(row.holds for row in rows)} of {len(rows)} hold")
for row in rows:
    if not row.holds:
        print(f"{row.claim.name}: {row.claim.lost}")
