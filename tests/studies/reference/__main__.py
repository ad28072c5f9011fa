"""Print the published numbers beside our results, the reason of each disagreement, and counts.

`published.csv` also has the numbers that the simulation does not model, with the reason.
"""

from __future__ import annotations

from collections import Counter

from tests.studies.reference.comparing import compare_number
from tests.studies.reference.published import WIDE, read_published
from virtual_lab.output.tables import table_text

rows = [compare_number(number) for number in read_published() if number.role != "none"]
roles = Counter(row.role for row in rows)
disagreements = [row for row in rows if "agrees" != row.agreement != WIDE]
print(table_text(rows), end="\n\n")
for row in disagreements:
    size = f"{row.difference:+.3g} {row.unit.removeprefix('1')}".rstrip()
    print(f"{row.quantity}: {row.agreement}, {size} ({row.number.why})")
print(
    f"\n{len(rows)} of {len(read_published())} published numbers represented: "
    f"{roles['prediction']} predicted, {roles['wide']} with a range too wide to decide, "
    f"{roles['data']} in the data files, {roles['fit']} to which a constant was fitted; "
    f"{len(disagreements)} disagree"
)
