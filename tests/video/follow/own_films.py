"""Films of the rig `filmed-cannon`, measured by `track` and compared with the true speeds.

python -m tests.video.follow.own_films OUT.txt [SHOTS SEED ...]

In the laboratory of each seed (7 and 8), the first 5 shots whose rebound the gates time are
filmed as by `certify ea70 --procedure bbcor --rig filmed-cannon --film`, which films the first
shot only. Each film is tracked with the calibration file beside it.
"""

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd

from tests.laboratories import opened
from virtual_lab.lab.filming import film_of
from virtual_lab.lab.test_day import TestDay
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.video.show.tracked_clip import track_clip


def rows_of(seed: int, shots: int) -> Iterator[dict[str, object]]:
    """Yield the table's row of each shot."""
    setup = {"procedure": "bbcor", "rig": "filmed-cannon", "detail": RecordDetail.SUMMED}
    day = TestDay.begin(opened("ea70", seed=seed, **setup))
    day = day.measure_bat().hit_wall().prepare()
    day = day.fire(day.next_shots()).judge()
    laboratory, plan, readings = day.laboratory, day.plans[0], day.readings
    assert readings is not None
    session, truth = day.session, day.rounds[0].truth
    timed = np.flatnonzero(np.isfinite(readings.flights.raw.speed_out))
    for shot in timed[:shots]:
        names = ("slot", "ball", "speed", "place", "turn_rate")
        one = replace(plan, **{name: getattr(plan, name)[[shot]] for name in names})
        part = readings.flights.part(np.array([shot]))
        film = film_of(laboratory.impact, one, laboratory.specimen, laboratory.draws, session, part)
        with tempfile.TemporaryDirectory() as folder:
            film(Path(folder))
            calibration = Path(folder) / "calibration.toml"
            track = track_clip(Path(folder) / "shot-0.mp4", {"file": calibration})
        speed, rebound = truth["speed"][shot], truth["rebound_speed"][shot]
        (contact,) = track.contacts
        measured = {
            "v_in": (track.flights[0].speed_out, speed),
            "v_out": (track.flights[1].speed_in, rebound),
            "e": (contact.restitution or Estimate(value=np.nan), rebound / speed),
        }
        row: dict[str, object] = {"seed": seed, "shot": shot, "true v_out": round(rebound, 2)}
        for name, (said, true) in measured.items():
            row[f"{name} u %"] = round(100 * said.u / true, 3)
            row[f"{name} error %"] = round(100 * (said.value / true - 1), 3)
            row[f"{name} z"] = round((said.value - true) / said.u, 2)
        yield row | {"flags": " ".join(track.flags)}


def main(out: Path, shots: int, seeds: list[int]) -> None:
    """Write one row per shot, then the rms of z and the number of shots inside 2 u."""
    table = pd.DataFrame([row for seed in seeds for row in rows_of(seed, shots)])
    lines = [table.to_string(index=False), ""]
    for name in ("v_in", "v_out", "e"):
        z = table[f"{name} z"].to_numpy(float)
        inside = int((np.abs(z) <= 2).sum())
        rms = np.sqrt(np.mean(z**2))
        lines.append(f"{name}: {inside} of {len(z)} inside 2 u, rms z {rms:.2f}")
    out.write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    arguments = [int(each) for each in sys.argv[2:]]
    main(Path(sys.argv[1]), (arguments or [5])[0], arguments[1:] or [7, 8])
