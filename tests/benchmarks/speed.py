"""Time per collision: by model, by peers, and their ratios.

Everything runs on one core, on scenes of one bat (R161). Compared works are timed in turn, because
ratios of times from different minutes compare the load of the machine. Peers start with the mode
shapes at the impact, as our stepper does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.benchmarks.compiled_peers import by_compiled_dop853, numbalsoda_peers
from tests.benchmarks.machine import Work, in_turn, seconds
from tests.benchmarks.peers import Peer, Scaled, by_solve_ivp
from tests.benchmarks.rows import Row
from tests.benchmarks.scenes import NARROW, default_model, eight_modes, struck
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.collision.stepping import STAYS, STEPPER, WINDOW, CollisionBatch

__all__ = ["speed"]

Floats = NDArray[np.float64]
Peers = Iterator[tuple[str, Peer]]
PART = "speed: R161, z 1-12 in, 40-180 mph, e0 0.4-0.6, exponent 1-2, wall contact 0.6-1 ms"
BATCH, PEER_SCENES, SEED = 16_384, 60, 7
ROUNDS, PEER_REPEATS, SHORT_LIST = 15, 5, 3
AGAINST_SOLVE_IVP = 250.0
AGAINST_NUMBALSODA = 3.0
GOOD = 1e-6  # largest error of a peer that is compared
SOLVE_IVP = {
    "DOP853": (1e-5, 1e-6, 3e-7, 2e-7, 1e-7, 1e-8),
    "RK45": (1e-5, 1e-6, 3e-7, 1e-7, 1e-8),
    "LSODA": (1e-5, 1e-6, 3e-7, 1e-7, 1e-8),
    "Radau": (1e-3, 1e-4, 1e-5),
    "BDF": (1e-6, 1e-7, 1e-8),
}
COMPILED = (1e-4, 1e-5, 3e-6, 1e-6, 3e-7, 1e-7)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Setting:
    """A model and scenes for it."""

    what: str
    model: ModalModel
    scenes: Scenes

    def works(self) -> dict[str, Work]:
        """Return the works to be timed, of which each includes the previous one.

        The kernel is one pass of the compiled loop over all scenes; the stepper repeats doubtful
        scenes; "all" is `ModalModel.collide`, from scenes to energies.
        """
        batch = struck(self.model, self.scenes)
        return {
            "kernel": lambda: STEPPER.one_pass(batch, WINDOW),
            "stepper": lambda: STEPPER.follow(batch, WINDOW),
            "all": lambda: self.model.collide(self.scenes),
        }


def speed(batch: int = BATCH) -> Iterator[Row]:
    """Yield times and errors of our stepper, then of the peers."""
    scenes = NARROW.draw(batch, SEED)
    models = (("8 modes", eight_modes("r161")), ("20 + residual", default_model("r161")))
    settings = [_Setting(what=label, model=model, scenes=scenes) for label, model in models]
    for setting in settings:
        yield from _ours(setting)
    for kind, aim, peers in _kinds():
        yield from _against(settings[0], kind, aim, peers)


def _ours(setting: _Setting) -> Iterator[Row]:
    scenes = setting.scenes
    batch = struck(setting.model, scenes)
    times = in_turn(setting.works(), ROUNDS)
    us = {name: float(np.median(values)) / len(scenes) * 1e6 for name, values in times.items()}
    followed, exact = (way.follow(batch) for way in (STEPPER, STEPPER.refine(12.0)))
    error = _error(batch, scenes, followed.states[:, -1], exact.states[:, -1])
    redone = f"{np.mean(followed.redone > 0):.2%} of the scenes again"

    def row(what: str, value: float, **other: Any) -> Row:
        return Row(part=PART, what=f"{setting.what}: {what}", value=value, **other)

    yield row("kernel", us["kernel"], unit="us")
    yield row("stepper", us["stepper"], unit="us", note=redone)
    yield row("all", us["all"], unit="us")
    yield row("largest error", error, at_most=STAYS)
    steps = float(STEPPER.one_pass(batch)[0].steps.mean())
    yield row("steps of 11 evaluations", steps)


def _kinds() -> Iterator[tuple[str, float | None, Callable[[], Peers]]]:
    """Yield kinds of peers, the targets of their time ratios, and functions that list the peers."""

    def scipy() -> Peers:
        for method, tolerances in SOLVE_IVP.items():
            for tolerance in tolerances:
                name = f"solve_ivp {method}, tolerance {tolerance:g}"
                yield name, by_solve_ivp(method, tolerance)

    def compiled() -> Peers:
        for tolerance in COMPILED:
            yield f"compiled DOP853, tolerance {tolerance:g}", by_compiled_dop853(tolerance)

    def fortran() -> Peers:
        of = numbalsoda_peers()
        for tolerance in COMPILED:
            yield f"numbalsoda DOP853, tolerance {tolerance:g}", of(tolerance)

    yield "solve_ivp", AGAINST_SOLVE_IVP, scipy
    yield "compiled DOP853", None, compiled
    yield "numbalsoda", AGAINST_NUMBALSODA, fortran


def _against(
    ours: _Setting, kind: str, aim: float | None, peers: Callable[[], Peers]
) -> Iterator[Row]:
    """Measure all peers of a kind, then the fastest accurate ones in turn with our stepper."""
    scenes = NARROW.draw(PEER_SCENES, SEED)
    batch = struck(ours.model, scenes)
    scaled = Scaled.of(batch)
    exact = STEPPER.refine(12.0).follow(batch).states[:, -1]
    good: list[tuple[float, str, Peer]] = []
    try:
        for what, peer in peers():
            error = _error(batch, scenes, peer(scaled) * batch.speed, exact)
            time = seconds(lambda peer=peer: peer(scaled), PEER_REPEATS) / PEER_SCENES
            yield Row(part=PART, what=what, value=time * 1e6, unit="us", error=error)
            if error <= GOOD:
                good.append((time, what, peer))
    except (ImportError, OSError):
        yield Row(part=PART, what=kind, note="skipped: not installed, or its library does not load")
        return
    works: dict[str, Work] = {
        what: lambda peer=peer: peer(scaled) for _, what, peer in sorted(good)[:SHORT_LIST]
    }
    times = in_turn(ours.works() | works, ROUNDS)
    best = min(works, key=lambda what: float(np.median(times[what])))
    for part in ours.works():
        ratio = np.median(times[best] / times[part]) * len(ours.scenes) / PEER_SCENES
        yield Row(
            part=PART,
            what=f"best {kind} over our {part}",
            value=float(ratio),
            unit="x",
            at_least=aim,
            note=best,
        )


def _error(batch: CollisionBatch, scenes: Scenes, rates: Floats, exact: Floats) -> float:
    """Return the largest error of e_A from the rates of s (as in `modal_kernel`) after release."""
    momentum = scenes.ball_mass * batch.speed
    return float(np.abs((rates - exact) / batch.inverse_mass / momentum).max())
