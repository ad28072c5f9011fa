"""Sound laboratories beside their twins: readings pointed at, and u over errors.

    python -m tests.studies.twin PROCEDURE LABORATORIES DAYS OUT.CSV

One row per laboratory and reading, with its tail probability among DAYS full days; rows of the
metric have the stated u over the standard deviation of 1 000 summed days. The bat is an individual
r161, or softball-34 for asa. The twin sees the records only.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from tests.laboratories import certify
from virtual_lab.studies.twin.days import scattered_as_stated
from virtual_lab.studies.twin.readings import unlike_readings
from virtual_lab.studies.twin.statement import stated_by
from virtual_lab.studies.twin.twin import summed_days

SEED = 8_200_000
FIELDS = ("procedure", "laboratory", "reading", "tail", "adjusted", "ratio", "days")


def main(procedure: str, laboratories: int, days: int, out: Path) -> None:
    bat = "softball-34" if procedure == "asa" else "r161"
    with out.open("w", newline="") as file:
        table = csv.DictWriter(file, FIELDS)
        table.writeheader()
        for number in range(laboratories):
            tested = certify(bat, procedure=procedure, seed=SEED, number=number)
            certification = tested.certification
            playing = scattered_as_stated(stated_by(certification), seed=number)
            about = {"procedure": procedure, "laboratory": number}
            (metric, *_), played = summed_days(certification, playing, 1000)
            table.writerow(
                about | {"reading": "metric", "ratio": f"{metric.ratio:.3f}", "days": 1000 - played}
            )
            rows, played = unlike_readings(certification, playing, days)
            for row in rows:
                tails = {"tail": f"{row.tail:.4f}", "adjusted": f"{row.adjusted:.4f}"}
                table.writerow(about | {"reading": row.reading, "days": played} | tails)
            file.flush()


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
