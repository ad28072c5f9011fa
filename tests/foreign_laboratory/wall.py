"""Coverage of e0 by bbcor, with wall records written by a program of another laboratory.

    python -m tests.foreign_laboratory.wall 150 1 wall.csv

The e0 of each ball falls with its own power of the speed, the cannon misses the nominal speed, and
the curtains are 1.2 mm thick. The wall uses nothing of the simulation: a flight against quadratic
drag is x(t) = ln(1 + κ v t)/κ on the way out, and the same backward in time on the way in. Bench
and bat are those of one simulated session, on which e0 hardly depends.
"""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.laboratories import certify
from virtual_lab.measurement.certification import certify_session
from virtual_lab.records.session import Session

MPH = 0.44704
SPEEDS, HITS = (60.0, 136.0), 4  # speeds [mph], hits of each ball at each speed
FIELDS = ("off_mph", "laboratories", "held", "mean_z", "sd_z")


def wall_of(session: Session, seed: int, off: float) -> tuple[Session, float]:
    """Return the session with other balls at another wall, and the lot's true e0 at 136 mph.

    All hits at one nominal speed have a common speed error, normal with standard deviation `off`
    [mph].
    """
    rng, calibration = np.random.default_rng([20261126, seed]), session.calibration

    def drawn(name: str) -> float:
        return float(rng.normal(calibration[name].value, calibration[name].u))

    mass = session.records["bench"]["ball-mass"].readings.mean(axis=1)
    balls = mass.size
    at_60 = rng.normal(0.542, 0.002, balls)
    power = rng.normal(-0.165, 0.008, balls)
    true = float(np.mean(at_60 * (136 / 60) ** power))

    ball = np.tile(np.repeat(np.arange(balls), HITS), len(SPEEDS))
    nominal = np.repeat(SPEEDS, balls * HITS)
    into = rng.normal(nominal, 0.6) + off * np.repeat(rng.normal(size=2), balls * HITS)
    e0 = at_60[ball] * (into / 60) ** power[ball] + rng.normal(0, 0.003, ball.size)

    radius, density = drawn("ball.radius"), drawn("hall.air.density")
    area = np.pi * radius**2 * density * drawn("hall.air.drag_coefficient")
    kappa = (area / (2 * mass[ball]))[:, None, None, None]
    gates = np.array([drawn(f"balls.gates.distance_{gate}") for gate in (0, 1)])
    edges = (radius + 0.6e-3) * np.array([[1.0, -1.0], [-1.0, 1.0]])  # plus half a curtain
    place = gates[:, None] + edges[:, None]  # ball's center, (way, gate, edge)
    speed = np.stack([into, into * e0], axis=1)[:, :, None, None] * MPH
    sign = np.array([-1.0, 1.0])[None, :, None, None]
    since = np.expm1(sign * kappa * place) / (kappa * speed)
    times = drawn("balls.gates.clock") * (0.05 + since) + rng.normal(0, 1e-6, since.shape)

    log = replace(
        session.records["balls"]["log"],
        ball=ball.astype(float),
        nominal_speed=nominal * MPH,
        place=np.zeros(ball.size),
    )
    gate = replace(session.records["balls"]["gates"], times=np.round(times, 6))
    thick = replace(calibration["balls.gates.clock"], value=1.2e-3, u=1e-4)
    return (
        replace(
            session,
            records=session.records | {"balls": {"log": log, "gates": gate}},
            calibration={**calibration, "balls.gates.thickness": thick},
        ),
        true,
    )


def main(number: int, off: float, into: Path) -> None:
    """Append a row to a table: the number of laboratories whose interval contains the true e0."""
    session = certify("r161", procedure="bbcor", seed=88_000).certification.session
    bench = {name: each for name, each in session.records["bench"].items() if name != "climate"}
    session = replace(session, records=session.records | {"bench": bench})
    held, z = 0, []
    for seed in range(number):
        other, true = wall_of(session, seed, off)
        e0 = certify_session(other).quantities.get("ball_restitution")
        if e0 is None:
            continue  # lot without a maximum of the scan
        low, high = e0.interval_95
        held += low <= true <= high
        z.append((e0.value - true) / e0.u)
    row = (off, len(z), held, f"{np.mean(z):.2f}", f"{np.std(z):.2f}")
    new = not into.exists()
    with into.open("a", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([*([FIELDS] if new else []), row])


if __name__ == "__main__":
    main(int(sys.argv[1]), float(sys.argv[2]), Path(sys.argv[3]))
