"""Which collision model a scene needs: the cheapest whose error is small enough, and why."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog.specs import BallSpec, BatBody
from virtual_lab.errors import InputError
from virtual_lab.simulation.collision.modal import ModalModel
from virtual_lab.simulation.collision.reference import ReferenceModel
from virtual_lab.simulation.collision.rigid import RigidModel
from virtual_lab.simulation.collision.scene import CollisionModel, Scenes
from virtual_lab.simulation.collision.store import surrogate_of
from virtual_lab.simulation.collision.surrogate import Box
from virtual_lab.simulation.physics.supports import Support
from virtual_lab.units import INCH

__all__ = [
    "MODAL_ERROR",
    "RUNGS",
    "Choice",
    "EfficiencyChoice",
    "Ladder",
    "choose",
    "choose_efficiency",
    "probing_scenes",
]

RUNGS = ("rigid", "modal", "reference")
PROBED_IN = (4.0, 5.5, 7.0, 8.5)  # from the tip
SHARE = 0.1  # of the standard uncertainty that a model's error may take
# Worst e_A error of the modal rung, truncation and stepping together, at z = 1 to 12 in over
# 2 000 scenes, free and pinned, wood and aluminium. In the last inch (the patch shrinks to a
# point) and close to the pivot it grows to 2e-3.
MODAL_ERROR = 1.1e-4
SURROGATE_TOLERANCE = SHARE * MODAL_ERROR


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A model, its error in e_A, and one sentence on why it was taken."""

    model: CollisionModel
    error: float
    reason: str


def choose(
    body: BatBody,
    support: Support,
    probe: Scenes,
    *,
    rung: str | None = None,
    standard_uncertainty: float | None = None,
) -> Choice:
    """Return the rung named, or the cheapest one good enough.

    Parameters
    ----------
    body, support
        The bat and how it is held.
    probe : Scenes
        A few scenes like those to come; the error of the rigid rung is measured on them.
    rung : str, optional
        One of `RUNGS`, taken whatever its error.
    standard_uncertainty : float, optional
        Of the e_A the scenes are to yield; without it and without `rung`, modal is taken.

    Raises
    ------
    InputError
        An unknown rung, or an uncertainty that is not positive.
    """
    _check(rung, standard_uncertainty)
    modal = ModalModel.of(body, support)
    if rung == "modal" or (rung is None and standard_uncertainty is None):
        why = "was asked for" if rung else "is the default"
        return Choice(model=modal, error=MODAL_ERROR, reason=f"modal {why}; {_error(MODAL_ERROR)}")
    if rung == "reference":
        reference = ReferenceModel.of(body, support)
        return Choice(model=reference, error=0.0, reason="reference was asked for")
    rigid = RigidModel.of(body, support)
    gap = rigid.collide(probe).collision_efficiency - modal.collide(probe).collision_efficiency
    rigid_error = float(np.abs(gap).max()) + MODAL_ERROR
    if rung == "rigid" or standard_uncertainty is None:
        reason = f"rigid was asked for; {_error(rigid_error)}"
        return Choice(model=rigid, error=rigid_error, reason=reason)
    allowed = SHARE * standard_uncertainty
    for model, error in ((rigid, rigid_error), (modal, MODAL_ERROR)):
        if error <= allowed:
            reason = f"{model.rung} is the cheapest good enough: {_error(error, allowed)}"
            return Choice(model=model, error=error, reason=reason)
    reference = ReferenceModel.of(body, support)
    reason = f"reference, for modal is not good enough: {_error(MODAL_ERROR, allowed)}"
    return Choice(model=reference, error=0.0, reason=reason)


@dataclass(frozen=True, slots=True, kw_only=True)
class EfficiencyChoice:
    """A way to e_A alone, its error, and one sentence on why it was taken."""

    efficiency: Callable[[Scenes], NDArray[np.float64]]
    rung: str
    error: float
    reason: str


def choose_efficiency(
    body: BatBody,
    support: Support,
    probe: Scenes,
    box: Box,
    *,
    standard_uncertainty: float,
) -> EfficiencyChoice:
    """Return the cheapest way to e_A of many scenes, nothing else of them being needed.

    As `choose`, with the surrogate between rigid and modal: it is built over `box`, unless a
    scene in there re-loads. A scene outside the box goes to the modal rung, alone.
    """
    choice = choose(body, support, probe, standard_uncertainty=standard_uncertainty)
    plain = EfficiencyChoice(
        efficiency=lambda given: choice.model.collide(given).collision_efficiency,
        rung=choice.model.rung,
        error=choice.error,
        reason=choice.reason,
    )
    error, allowed = MODAL_ERROR + SURROGATE_TOLERANCE, SHARE * standard_uncertainty
    if plain.rung != "modal" or error > allowed:
        return plain
    try:
        surrogate = surrogate_of(body, support, box, tolerance=SURROGATE_TOLERANCE)
    except InputError as refused:
        return replace(plain, reason=f"{plain.reason}; no surrogate: {refused}")

    def efficiency(scenes: Scenes) -> NDArray[np.float64]:
        inside = box.inside(scenes)
        if inside.all():
            return surrogate.efficiency(scenes)
        found = np.empty(len(scenes))
        for some, way in ((inside, surrogate.efficiency), (~inside, plain.efficiency)):
            if some.any():
                found[some] = way(scenes.part(some))
        return found

    return EfficiencyChoice(
        efficiency=efficiency,
        rung=surrogate.rung,
        error=error,
        reason=f"surrogate is the cheapest good enough: {_error(error, allowed)}",
    )


def _check(rung: str | None, uncertainty: float | None) -> None:
    if rung is not None and rung not in RUNGS:
        raise InputError("collision", "rung", rung, f"allowed: {', '.join(RUNGS)}")
    if uncertainty is not None and not uncertainty > 0:
        raise InputError("collision", "standard_uncertainty", uncertainty, "allowed: above 0")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ladder:
    """The collision for the scenes of one test: chosen once for each bat and support.

    What it answers depends on a scene alone: not on the scenes beside it or before it.
    """

    probe: Scenes
    standard_uncertainty: float | None  # of the e_A that the test is to yield; None: modal
    rung: str | None = None
    box: Box | None = None  # about scenes so many that a surrogate is worth building
    taken: dict[tuple[BatBody, Support], Choice] = field(default_factory=dict)
    fitted: dict[tuple[BatBody, Support], EfficiencyChoice] = field(default_factory=dict)

    def __call__(self, body: BatBody, support: Support) -> CollisionModel:
        """Return the model for a bat under a support."""
        key = (body, support)
        if key not in self.taken:
            self.taken[key] = choose(
                body,
                support,
                self.probe,
                rung=self.rung,
                standard_uncertainty=self.standard_uncertainty,
            )
        return self.taken[key].model

    def efficiency(self, body: BatBody, support: Support, scenes: Scenes) -> NDArray[np.float64]:
        """Return e_A alone of scenes of a bat under a support, by the cheapest way there is."""
        u, key = self.standard_uncertainty, (body, support)
        if self.rung is not None or u is None or self.box is None:
            return self(body, support).collide(scenes).collision_efficiency
        if key not in self.fitted:
            self.fitted[key] = choose_efficiency(
                body, support, self.probe, self.box, standard_uncertainty=u
            )
        return self.fitted[key].efficiency(scenes)

    def true_efficiency(
        self, body: BatBody, support: Support, scenes: Scenes
    ) -> NDArray[np.float64]:
        """Return e_A of the scenes that the truth rests on, whatever rung the shots take.

        By the modal rung, or the reference where that was asked for; where a surrogate serves
        many laboratories, by the one that serves their shots.
        """
        if self.box is not None and self.rung is None:
            return self.efficiency(body, support, scenes)
        if self.rung == "reference":
            return self(body, support).collide(scenes).collision_efficiency
        return ModalModel.of(body, support).collide(scenes).collision_efficiency

    def report(self) -> dict[str, str | float]:
        """Return the rung first taken, its error in e_A, and why."""
        for choice in self.taken.values():
            return {"rung": choice.model.rung, "error": choice.error, "reason": choice.reason}
        fitted = next(iter(self.fitted.values()))
        return {"rung": fitted.rung, "error": fitted.error, "reason": fitted.reason}


def probing_scenes(ball: BallSpec, speed: float) -> Scenes:
    """Return scenes of a nominal ball at `speed` [m/s] about the barrel, to compare rungs on."""
    return Scenes.with_ball(ball, impact_position=np.array(PROBED_IN) * INCH, relative_speed=speed)


def _error(error: float, allowed: float | None = None) -> str:
    most = "" if allowed is None else f", at most {allowed:.1e} may be"
    return f"its e_A errs by up to {error:.1e}{most}"
