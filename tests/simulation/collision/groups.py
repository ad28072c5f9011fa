"""Groups of scenes whose reference e_A is stored, from usual ones to the edges of the ranges.

``python -m tests.simulation.collision.groups`` recomputes the stored references in one minute.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import astuple, fields, replace
from pathlib import Path

import numpy as np

from tests.benchmarks.scenes import WIDE, eight_modes, struck
from tests.simulation.collision.oracle import Reference, solve
from tests.simulation.collision.scenes import scattered, usual
from virtual_lab.catalog import load_bat
from virtual_lab.catalog.specs import BatBody, HoopMode
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.physics.beam import Clamped, Free, Pinned, Support
from virtual_lab.units import INCH

__all__ = ["GROUPS", "Group", "references"]

TABLE = Path(__file__).with_name("references.csv")
Group = tuple[ModalModel, Scenes]
SUPPORTS: dict[str, Support] = {
    "free": Free(),
    "pinned": Pinned(28 * INCH),
    "spring": Pinned(28 * INCH, 1e6),
    "clamped 31": Clamped(31 * INCH),
    "clamped 20": Clamped(20 * INCH),
}


def body_of(bat: str) -> BatBody:
    """Return the body of a bat of the catalog."""
    return load_bat(bat).spec.body


def on(bat: str, support: str = "free", modes: int = 20) -> ModalModel:
    """Return the model of a bat of the catalog."""
    return ModalModel.of(body_of(bat), SUPPORTS[support], modes)


def with_all(scenes: Scenes, **changes: float) -> Scenes:
    """Return the scenes with the given values in every scene."""
    return replace(scenes, **{name: np.full(len(scenes), value) for name, value in changes.items()})


def harder(scenes: Scenes, factor: float) -> Scenes:
    """Return the scenes with stiffer balls."""
    return replace(scenes, stiffness=factor * scenes.stiffness)


def light(bat: str) -> ModalModel:
    """Return the model of a bat with a twentieth of its mass."""
    body = body_of(bat)
    material = replace(body.material, density=body.material.density / 20)
    return ModalModel.of(replace(body, material=material), Free())


def hoop(frequency: float) -> ModalModel:
    """Return the model of a hollow bat with another hoop mode."""
    return ModalModel.of(
        replace(body_of("ea70"), hoop=HoopMode(frequency=frequency, modal_mass=0.1)), Free()
    )


def hidden(bat: str, support: str, *values: float) -> Group:
    """Return a scene in which the ball is compressed slightly deeper the second time."""
    z, speed, e0, stiffness, exponent = values
    scenes = Scenes.of(
        impact_position=z,
        relative_speed=speed,
        ball_mass=0.145,
        ball_restitution=e0,
        stiffness=stiffness,
        exponent=exponent,
    )
    return on(bat, support), scenes


GROUPS: dict[str, Callable[[], Group]] = {
    **{
        f"{bat} {support}": lambda bat=bat, support=support: (
            on(bat, support),
            scattered(6, 1, 11, seed=4),
        )
        for bat in ("r161", "ea70")
        for support in ("free", "pinned", "spring")
    },
    **{
        f"wide {bat} {support}": lambda bat=bat, support=support: (
            on(bat, support),
            WIDE.draw(24, 20),
        )
        for bat, support in (
            ("r161", "free"),
            ("ea70", "free"),
            ("barrel-loaded", "pinned"),
            ("knob-loaded", "clamped 31"),
        )
    },
    "knob-loaded at the handle": lambda: (
        on("knob-loaded", "clamped 31"),
        replace(WIDE.draw(24, 23), impact_position=np.linspace(22, 30.5, 24) * INCH),
    ),
    "eight modes": lambda: (eight_modes("r161"), WIDE.draw(24, 21)),
    "forty modes": lambda: (on("r161", modes=40), WIDE.draw(6, 22)),
    "reloads": lambda: (on("ea70"), scattered(16, 18, 24, seed=5)),
    "tip": lambda: (on("r161"), scattered(16, 0.0, 0.6, seed=6)),
    "grazing second contacts": lambda: (on("r161"), scattered(24, 13, 17, seed=11)),
    "clamped near the impact": lambda: (on("ea70", "clamped 20"), scattered(8, 0.5, 19, seed=3)),
    "heavy balls": lambda: (
        on("ea70", "clamped 20"),
        replace(scattered(8, 0.5, 19, seed=3), ball_mass=np.repeat([0.45, 4.5], 4)),
    ),
    "light bat": lambda: (light("r161"), scattered(8, 0.5, 30, seed=4)),
    "light hollow bat": lambda: (light("ea70"), scattered(8, 0.5, 30, seed=4)),
    "stiffness times 10": lambda: (on("r161"), harder(scattered(8, 0.5, 30, seed=5), 10)),
    "stiffness times 100": lambda: (
        on("r161"),
        usual([1.0, 4.0, 6.5], stiffness=3.5e8, ball_restitution=0.45),
    ),
    "stiffness to 1e14": lambda: (
        on("r161", "pinned"),
        usual([6.0] * 4, relative_speed=50.0, stiffness=np.array([1e9, 1e10, 1e12, 1e14])),
    ),
    "e0 of .02": lambda: (on("r161", "pinned"), usual([6.0, 16.0], ball_restitution=0.02)),
    "e0 of .05": lambda: (
        on("r161"),
        with_all(scattered(4, 0.5, 30, seed=7), ball_restitution=0.05),
    ),
    **{
        f"e0 of {e0:g} {bat}": lambda e0=e0, bat=bat: (
            on(bat),
            with_all(scattered(12, 0.5, 30, seed=7), ball_restitution=e0),
        )
        for e0 in (0.2, 0.999, 1.0)
        for bat in ("r161", "ea70")
    },
    **{
        f"hoop mode of {frequency} Hz": lambda frequency=frequency: (
            hoop(frequency),
            scattered(6, 0.5, 30, seed=8),
        )
        for frequency in (600, 1000, 1500, 2500)
    },
    "exponent of 3": lambda: (
        on("r161"),
        usual([2.0, 6.0, 20.0], exponent=3.0, stiffness=2.4e10),
    ),
    "slow": lambda: (
        on("r161"),
        usual([2.0, 6.0, 20.0], relative_speed=np.array([1e-3, 0.1, 1.0]), exponent=1.5),
    ),
    "hidden peak, hollow bat": lambda: hidden(
        "ea70", "free", 0.6298974330236085, 56.75869133629618, 0.383760322709, 198352702.773,
        1.86869395402,
    ),
    "hidden peak, clamped bat": lambda: hidden(
        "knob-loaded", "clamped 31", 0.534214198658705, 30.09602348039845, 0.337094863262,
        583718281.405, 1.80876662943,
    ),
}  # fmt: skip


def references(group: str) -> list[Reference]:
    """Return the stored results of a group."""
    with TABLE.open(newline="") as file:
        return [
            Reference(float(e_A), int(contacts), int(reloads))
            for name, e_A, contacts, reloads in csv.reader(file)
            if name == group
        ]


def main() -> None:
    """Compute the reference of each scene and write the table."""
    with TABLE.open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["group", *(field.name for field in fields(Reference))])
        for name, group in GROUPS.items():
            for result in solve(struck(*group())):
                e_A, *counts = astuple(result)
                rows.writerow([name, f"{e_A:.11f}", *counts])


if __name__ == "__main__":
    main()
