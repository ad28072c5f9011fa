"""Which collision model a scene needs: the cheapest whose error is small enough, and why.

The errors are those of a bat under a support on scenes like those to come. In a test both are
nominal: a rung chosen by the bat tested, or its error in print, would tell of its true stiffness.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog.specs import BallSpec, BatBody
from virtual_lab.errors import InputError
from virtual_lab.records.origin import RungTaken
from virtual_lab.simulation.collision.modal import (
    BENDING_MODES,
    STIFF_MODES,
    ModalModel,
    collide_bats,
)
from virtual_lab.simulation.collision.patch import PATCH, patch_shape
from virtual_lab.simulation.collision.reference import ReferenceModel
from virtual_lab.simulation.collision.rigid import RigidModel
from virtual_lab.simulation.collision.scene import CollisionModel, Collisions, Scenes
from virtual_lab.simulation.collision.surrogate import Box, Surrogate
from virtual_lab.simulation.physics.beam import Support, support_words
from virtual_lab.simulation.physics.modes import Modes, modes_of
from virtual_lab.units import INCH, Array

Shots = NDArray[np.intp] | slice
StruckBat = tuple[BatBody, Shots]  # and which of some scenes are its own
COLLISION_RUNGS = ("rigid", "modal", "reference")
MODE_COUNTS = (14, 20, 30)  # bending modes of the modal rungs, cheap to dear
SHARE = 0.1  # of the standard uncertainty that a model's error may take


@dataclass(frozen=True, slots=True, kw_only=True)
class Probing:
    """How errors of rungs are measured."""

    places: tuple[float, float] = (3 * INCH, 9 * INCH)  # m from the tip, where procedures strike
    every: float = INCH / 8  # finds the worst of a bat that the ball meets once to 1 %
    modes: int = 60  # that what fewer cost is measured against
    reference_modes: int = 140  # and what those of the reference cost
    # on a truncation: 1.5 for places between those probed and what the many modes err by, times
    # 1.25 for an individual two standard deviations softer than the nominal bat (1.24 was found)
    margin: float = 1.875
    # the same where ball and bat meet more often, for e_A goes up and down within a tenth of an
    # inch there and jumps where a touch comes or goes; no greater one of 24 000 on five bats was
    # found, a jump by 0.08 apart
    meeting_margin: float = 20.0
    stepping_error: float = 2e-6  # in e_A, of a try's tolerance and of splines for shapes
    surrogate_tolerance: float = 1.1e-5


PROBING = Probing()


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A model, its error in e_A, and one sentence on why it was taken."""

    name: str  # rung, and of how many modes
    model: CollisionModel
    error: float
    meets_again: bool = False  # ball and bat, in some scene of the probe
    reason: str = ""
    surrogate: Surrogate | None = None  # of the model, for e_A alone

    @property
    def rung(self) -> str:
        """Name of the rung."""
        return self.surrogate.rung if self.surrogate else self.model.rung

    def of(self, body: BatBody, support: Support) -> Choice:
        """Return the same rung for another individual under its own support."""
        count = self.model.modes.bending_frequencies.size
        return replace(self, model=_model(self.model.rung, count, body, support))

    def efficiency(self, scenes: Scenes) -> NDArray[np.float64]:
        """Return e_A of scenes, (n,); one outside the surrogate's box goes to the model, alone."""
        if self.surrogate is None:
            return self.model.collide(scenes).collision_efficiency
        inside = self.surrogate.box.inside(scenes)
        if inside.all():
            return self.surrogate.efficiency(scenes)
        found = np.empty(len(scenes))
        found[~inside] = self.model.collide(scenes.part(~inside)).collision_efficiency
        if inside.any():
            found[inside] = self.surrogate.efficiency(scenes.part(inside))
        return found


def choose(
    body: BatBody,
    support: Support,
    probe: Scenes,
    *,
    rung: str | None = None,
    standard_uncertainty: float | None = None,
) -> Choice:
    """Return the rung named, or the cheapest one good enough.

    Errors are measured on the `probe`, scenes like those to come. A `rung` of `COLLISION_RUNGS` is
    taken whatever its error, modal with the default number of modes; without it and without the
    standard uncertainty of the e_A that the scenes are to yield, modal is taken. `InputError` for
    an unknown rung, an uncertainty that is not positive, or a probe that no rung can follow.
    """
    _check(rung, standard_uncertainty)
    if rung == "reference":
        return _because(_reference(body, support, probe), "was asked for", probe)
    rungs = _rungs(body, support, probe)
    if rung is not None or standard_uncertainty is None:
        name = "rigid" if rung == "rigid" else _modal(BENDING_MODES)
        asked = next(one for one in rungs if one.name == name)
        return _because(asked, "was asked for" if rung else "is the default", probe)
    allowed = SHARE * standard_uncertainty
    for one in rungs:
        if one.error <= allowed:
            return _because(one, "is the cheapest good enough", probe, allowed)
    why = f"is taken, for with {_modal(MODE_COUNTS[-1])} it errs by up to {rungs[-1].error:.1e}"
    return _because(_reference(body, support, probe), why, probe, allowed)


def _rungs(body: BatBody, support: Support, probe: Scenes) -> list[Choice]:
    """Return the rigid and the modal rungs, cheap to dear, with their errors on the probe."""
    modes, held = modes_of(body, support, BENDING_MODES + STIFF_MODES), support_words(support)
    stepped = [ModalModel.within(modes, n, held=held) for n in (*MODE_COUNTS, PROBING.modes)]
    *found, true = _probed(modes, stepped, probe)
    rigid = RigidModel.of(body, support)
    found.insert(0, rigid.collide(probe))
    models: list[CollisionModel] = [rigid, *stepped[:-1]]
    names = ("rigid", *(_modal(count) for count in MODE_COUNTS))
    return [
        _measured(name, model, own, true)
        for name, model, own in zip(names, models, found, strict=True)
    ]


@lru_cache(maxsize=64)  # a block of individuals asks for the same round by round
def _model(rung: str, bending_modes: int, body: BatBody, support: Support) -> CollisionModel:
    if rung == "rigid":
        return RigidModel.of(body, support)
    if rung == "reference":
        return ReferenceModel.of(body, support)
    modes = modes_of(body, support, BENDING_MODES + STIFF_MODES)
    return ModalModel.within(modes, bending_modes, held=support_words(support))


def _reference(body: BatBody, support: Support, probe: Scenes) -> Choice:
    """Return the reference; what its modes leave out is measured against still more of them."""
    model = ReferenceModel.of(body, support)
    modes = modes_of(body, support, PROBING.reference_modes + STIFF_MODES)
    most = ModalModel.within(modes, PROBING.reference_modes, held=model.held)
    bare = replace(most, modes=model.modes, stiff=most.stiff.above(most.stiff.count))
    found, true = _probed(modes, [bare, most], probe)
    return _measured(model.rung, model, found, true)


def _measured(name: str, model: CollisionModel, found: Collisions, true: Collisions) -> Choice:
    """Return a rung with what its e_A errs by at most, as far as a probe shows."""
    again = bool(true.contacts.max() > 1)
    gap = np.abs(found.collision_efficiency - true.collision_efficiency).max()
    error = (PROBING.meeting_margin if again else PROBING.margin) * float(
        gap
    ) + PROBING.stepping_error
    return Choice(name=name, model=model, error=error, meets_again=again)


def _probed(modes: Modes, models: Sequence[ModalModel], probe: Scenes) -> list[Collisions]:
    """Return what the probe comes to by models of the lowest of `modes`, all shapes found once."""
    shapes, beam = patch_shape(modes, probe.impact_position, PATCH), modes.deflections.shape[1]
    tables = []
    for model in models:
        own = model.modes.deflections.shape[1]
        stiff = slice(own, own + model.stiff.count)
        compliance = np.sum((shapes[:, stiff] / modes.angular_frequencies[stiff]) ** 2, axis=1)
        tables.append(np.column_stack((shapes[:, :own], shapes[:, beam:], compliance)))
    return collide_bats([(model, probe) for model in models], tables)


def _modal(count: int) -> str:
    return f"modal, {count} modes,"


def _because(choice: Choice, why: str, probe: Scenes, allowed: float | None = None) -> Choice:
    low, high = (end / INCH for end in (probe.impact_position.min(), probe.impact_position.max()))
    most = "" if allowed is None else f", {allowed:.1e} may be"
    again = (
        ", more where a touch comes or goes: ball and bat meet again" if choice.meets_again else ""
    )
    said = f"its e_A errs by up to {choice.error:.1e} at {low:.4g} to {high:.4g} in from the tip"
    return replace(choice, reason=f"{choice.name} {why}: {said}{again}{most}")


def choose_efficiency(
    body: BatBody, support: Support, probe: Scenes, box: Box, *, standard_uncertainty: float
) -> Choice:
    """Return the cheapest way to e_A of many scenes, nothing else of them being needed.

    As `choose`, with the surrogate between rigid and modal: it is built over `box`, unless a
    scene in there re-loads.
    """
    choice = choose(body, support, probe, standard_uncertainty=standard_uncertainty)
    return _with_surrogate(choice, probe, box, standard_uncertainty)


def _with_surrogate(choice: Choice, probe: Scenes, box: Box, standard_uncertainty: float) -> Choice:
    error, allowed = choice.error + PROBING.surrogate_tolerance, SHARE * standard_uncertainty
    if not isinstance(choice.model, ModalModel) or error > allowed:
        return choice
    try:
        surrogate = Surrogate.build(choice.model, box, tolerance=PROBING.surrogate_tolerance)
    except InputError as refused:
        return replace(choice, reason=f"{choice.reason}; no surrogate: {refused}")
    name = f"surrogate of the rung {choice.name}"
    taken = replace(choice, name=name, error=error, surrogate=surrogate)
    return _because(taken, "is the cheapest good enough", probe, allowed)


def _check(rung: str | None, uncertainty: float | None) -> None:
    if rung is not None and rung not in COLLISION_RUNGS:
        raise InputError("collision", "rung", rung, f"allowed: {', '.join(COLLISION_RUNGS)}")
    if uncertainty is not None and not uncertainty > 0:
        raise InputError("collision", "standard_uncertainty", uncertainty, "allowed: above 0")


@dataclass(frozen=True, slots=True, kw_only=True)
class Ladder:
    """The collision in the scenes of one test: the rung is chosen once, by the nominal bat.

    So it follows from the setup of a test, and tests of one setup share it. What it answers
    depends on a bat, its support and a scene alone: not on the scenes beside it or before it.
    """

    nominal: BatBody
    support: Support  # of the nominal bat
    probe: Scenes
    standard_uncertainty: float | None  # of the e_A that the test is to yield; None: modal
    rung: str | None = None
    box: Box | None = None  # about scenes so many that a surrogate is worth building
    chosen: list[Choice] = field(default_factory=list)  # the one, once it was needed
    fitted: dict[tuple[BatBody, Support], Choice] = field(default_factory=dict)

    def with_box(self, box: Box) -> Ladder:
        """Return the same for very many scenes in a box, of which e_A alone is needed."""
        return replace(self, box=box, fitted={})

    @property
    def choice(self) -> Choice:
        """The rung, its error for individuals of the nominal bat, and why."""
        if not self.chosen:
            u = self.standard_uncertainty
            self.chosen.append(
                choose(
                    self.nominal, self.support, self.probe, rung=self.rung, standard_uncertainty=u
                )
            )
        return self.chosen[0]

    def __call__(self, body: BatBody, support: Support) -> CollisionModel:
        """Return the model for an individual under its support."""
        return self.choice.of(body, support).model

    def efficiencies(
        self, struck: Iterable[StruckBat], support: Support, scenes: Scenes
    ) -> NDArray[np.float64]:
        """Return e_A alone of scenes of some bats under a support, by the cheapest way there is."""
        u, box = self.standard_uncertainty, self.box
        if self.rung is not None or u is None or box is None:
            return _together([(self(body, support), shots) for body, shots in struck], scenes)
        found = np.empty(len(scenes))
        for body, shots in struck:
            if (body, support) not in self.fitted:
                own = self.choice.of(body, support)
                self.fitted[body, support] = _with_surrogate(own, self.probe, box, u)
            found[shots] = self.fitted[body, support].efficiency(scenes.part(shots))
        return found

    def true_efficiencies(
        self, struck: Iterable[StruckBat], support: Support, scenes: Scenes
    ) -> NDArray[np.float64]:
        """Return e_A of the scenes that the truth rests on, whatever rung the shots take.

        By that of the shots, a surrogate among them, but never by the rigid one.
        """
        if self.box is not None and self.rung is None:
            return self.efficiencies(struck, support, scenes)
        models = [(self._true(body, support), shots) for body, shots in struck]
        return _together(models, scenes)

    def _true(self, body: BatBody, support: Support) -> CollisionModel:
        model = self(body, support)
        return ModalModel.of(body, support) if isinstance(model, RigidModel) else model

    def report(self) -> RungTaken:
        """Return the rung, its error in e_A, and why; of the surrogate where there is one."""
        taken = next(iter(self.fitted.values()), None) or self.choice
        return RungTaken(rung=taken.rung, error=taken.error, reason=taken.reason)


def _together(models: Sequence[tuple[CollisionModel, Shots]], scenes: Scenes) -> Array:
    """Return e_A of scenes of some models; modal ones are stepped together."""
    found = np.empty(len(scenes))
    stepped = [(one, shots) for one, shots in models if isinstance(one, ModalModel)]
    if len(stepped) > 1:
        batch = [(one, scenes.part(shots)) for one, shots in stepped]
        for (_, shots), own in zip(stepped, collide_bats(batch), strict=True):
            found[shots] = own.collision_efficiency
        models = [each for each in models if not isinstance(each[0], ModalModel)]
    for one, shots in models:
        found[shots] = one.collide(scenes.part(shots)).collision_efficiency
    return found


def probing_scenes(
    ball: BallSpec, speed: float, places: tuple[float, float] = PROBING.places
) -> Scenes:
    """Return scenes of a nominal ball at `speed` [m/s] along the barrel, to compare rungs on.

    They reach over `places` [m from the tip] too, where these lie beyond where procedures strike.
    """
    low, high = min(places[0], PROBING.places[0]), max(places[1], PROBING.places[1])
    count = round((high - low) / PROBING.every) + 1
    return Scenes.with_ball(
        ball, impact_position=np.linspace(low, high, count), relative_speed=speed
    )
