"""Choice of the collision model for a test: the fastest one with a small enough error.

The models from fast to accurate form a ladder. The error of a model is measured on probe scenes
with a bat and its support. In a test both are nominal, because a model chosen for the individual
bat, or the printed error of such a model, would reveal the true stiffness of this bat.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from virtual_lab.catalog.specs import BallSpec, BatBody
from virtual_lab.errors import InputError
from virtual_lab.records.origin import ModelUsed
from virtual_lab.simulation.collision.modal import BENDING_MODES, ModalModel, collide_bats
from virtual_lab.simulation.collision.patch import PATCH, patch_shape
from virtual_lab.simulation.collision.reference import ReferenceModel
from virtual_lab.simulation.collision.rigid import RigidModel
from virtual_lab.simulation.collision.scene import CollisionModel, Collisions, Scenes
from virtual_lab.simulation.collision.surrogate import Box, Surrogate
from virtual_lab.simulation.physics.beam import Support, support_words
from virtual_lab.simulation.physics.modes import Modes, modes_of
from virtual_lab.units import INCH, Array

Shots = NDArray[np.intp] | slice
StruckBat = tuple[BatBody, Shots]  # a bat, and the scenes in which it is struck
# models without bending modes, from fast to accurate
SIMPLE: Mapping[str, Callable[[BatBody, Support], CollisionModel]] = {"rigid": RigidModel.of}
COLLISION_MODELS = (*SIMPLE, "modal", "reference")
MODE_COUNTS = (14, 20, 30)  # bending modes of the modal models, from fast to accurate
FASTEST = "the fastest model that is accurate enough"
SHARE = 0.1  # largest error of a model [share of the standard uncertainty of e_A]


@dataclass(frozen=True, slots=True, kw_only=True)
class Probing:
    """Settings of the probe that measures the errors of the models."""

    places: tuple[float, float] = (3 * INCH, 9 * INCH)  # usual impact positions [m from the tip]
    # spacing of positions [m], close enough for the largest error to 1 % if there is one contact
    every: float = INCH / 8
    modes: int = 60  # number of modes with which the modal models are compared
    reference_modes: int = 140  # number of modes with which the reference model is compared
    # factor on the truncation error: 1.5 for positions between the probed positions and for the
    # error of the comparison, times 1.25 for an individual bat two standard deviations softer than
    # the nominal bat (measured: 1.24)
    margin: float = 1.875
    # factor if ball and bat meet more than once, because e_A then varies within a tenth of an inch
    # and jumps where a contact appears or disappears. It is the largest factor of 24 000 scenes on
    # five bats, apart from one jump of 0.08.
    meeting_margin: float = 20.0
    stepping_error: float = 2e-6  # error of e_A caused by stepping tolerance and shape splines
    surrogate_tolerance: float = 1.1e-5


PROBING = Probing()


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """A collision model, its error of e_A, and the reason why it was chosen, in one sentence."""

    label: str  # name of the model, and number of modes
    model: CollisionModel
    error: float
    meets_again: bool = False  # whether ball and bat meet twice in any scene of the probe
    reason: str = ""
    surrogate: Surrogate | None = None  # interpolant of the model's e_A

    @property
    def model_name(self) -> str:
        """Name of the model, or of the surrogate if there is one."""
        return self.surrogate.name if self.surrogate else self.model.name

    def of(self, body: BatBody, support: Support) -> Choice:
        """Return the choice with the model of another individual bat and its support."""
        count = self.model.modes.bending_frequencies.size
        return replace(self, model=_model(self.model.name, count, body, support))

    def efficiency(self, scenes: Scenes) -> NDArray[np.float64]:
        """Return e_A of the scenes, (n,), by the surrogate in its box, elsewhere by the model."""
        if self.surrogate is None:
            return self.model.collide(scenes).collision_efficiency
        inside = self.surrogate.box.inside(scenes)
        if inside.all():
            return self.surrogate.efficiency(scenes)
        e_A = np.empty(len(scenes))
        e_A[~inside] = self.model.collide(scenes.part(~inside)).collision_efficiency
        if inside.any():
            e_A[inside] = self.surrogate.efficiency(scenes.part(inside))
        return e_A


def choose(
    body: BatBody,
    support: Support,
    probe: Scenes,
    *,
    model_name: str | None = None,
    standard_uncertainty: float | None = None,
) -> Choice:
    """Return the collision model for a bat, an upper estimate of its error, and the reason.

    The estimate is the largest error of the collision efficiency e_A in the scenes `probe`, times a
    safety factor. The scenes should be similar to the shots of the test. There are three cases:

    * `model_name` is given, one of `COLLISION_MODELS`. This model is used even if its error is
      large, and `standard_uncertainty` is ignored. The model ``modal`` has the default number of
      modes.
    * Only `standard_uncertainty` is given. It is the standard uncertainty u of the e_A that will be
      measured. The fastest model with an error of at most `SHARE` times this u is used. If there is
      no such model, the reference model is used.
    * Both are None. The model ``modal`` is used.

    Raises `InputError` for an unknown model, and for an uncertainty that is not positive. It is
    also raised for a support or a probe position beyond the bat, and for a probe scene that gives
    no result.
    """
    _check(model_name, standard_uncertainty)
    if model_name == "reference":
        return _because(_reference(body, support, probe), "as requested", probe)
    candidates = _candidates(body, support, probe)
    if model_name is not None or standard_uncertainty is None:
        label = model_name if model_name in SIMPLE else _modal(BENDING_MODES)
        choice = next(one for one in candidates if one.label == label)
        return _because(choice, "as requested" if model_name else "the default model", probe)
    allowed = SHARE * standard_uncertainty
    for one in candidates:
        if one.error <= allowed:
            return _because(one, FASTEST, probe, allowed)
    why = f"because the error of {MODE_COUNTS[-1]} modes is up to {candidates[-1].error:.1e}"
    return _because(_reference(body, support, probe), why, probe, allowed)


def _candidates(body: BatBody, support: Support, probe: Scenes) -> list[Choice]:
    """Return the simple and the modal models, fastest first, with their errors on the probe."""
    modes, support_text = modes_of(body, support), support_words(support)
    stepped = [
        ModalModel.within(modes, n, held=support_text) for n in (*MODE_COUNTS, PROBING.modes)
    ]
    *by_model, true = _collide_probe(modes, stepped, probe)
    simple = [model_of(body, support) for model_of in SIMPLE.values()]
    by_model = [*(each.collide(probe) for each in simple), *by_model]
    models: list[CollisionModel] = [*simple, *stepped[:-1]]
    labels = (*SIMPLE, *(_modal(count) for count in MODE_COUNTS))
    return [
        _measure_error(label, model, collisions, true)
        for label, model, collisions in zip(labels, models, by_model, strict=True)
    ]


@lru_cache(maxsize=64)  # a block needs the models of its bats in each round
def _model(name: str, bending_modes: int, body: BatBody, support: Support) -> CollisionModel:
    if name in SIMPLE:
        return SIMPLE[name](body, support)
    if name == "reference":
        return ReferenceModel.of(body, support)
    return ModalModel.of(body, support, bending_modes)


def _reference(body: BatBody, support: Support, probe: Scenes) -> Choice:
    """Return the reference model. Its truncation error is measured against more modes."""
    model = ReferenceModel.of(body, support)
    modes = modes_of(body, support)
    most = ModalModel.within(modes, PROBING.reference_modes, held=model.held)
    bare = replace(most, modes=model.modes, stiff=most.stiff.above(most.stiff.count))
    collisions, true = _collide_probe(modes, [bare, most], probe)
    return _measure_error(model.name, model, collisions, true)


def _measure_error(
    label: str, model: CollisionModel, collisions: Collisions, true: Collisions
) -> Choice:
    """Return a collision model and its largest error of e_A over the probe, plus a margin."""
    again = bool(true.contacts.max() > 1)
    gap = np.abs(collisions.collision_efficiency - true.collision_efficiency).max()
    error = (PROBING.meeting_margin if again else PROBING.margin) * float(
        gap
    ) + PROBING.stepping_error
    return Choice(label=label, model=model, error=error, meets_again=again)


def _collide_probe(modes: Modes, models: Sequence[ModalModel], probe: Scenes) -> list[Collisions]:
    """Return the collisions of the probe by each model.

    All models use the lowest of `modes`, so the mode shapes are interpolated once.
    """
    shapes, beam = patch_shape(modes, probe.impact_position, PATCH), modes.deflections.shape[1]
    tables = []
    for model in models:
        count = model.modes.deflections.shape[1]
        stiff = slice(count, count + model.stiff.count)
        compliance = np.sum((shapes[:, stiff] / modes.angular_frequencies[stiff]) ** 2, axis=1)
        tables.append(np.column_stack((shapes[:, :count], shapes[:, beam:], compliance)))
    return collide_bats([(model, probe) for model in models], tables)


def _modal(count: int) -> str:
    return f"modal, {count} modes,"


def _because(choice: Choice, why: str, probe: Scenes, allowed: float | None = None) -> Choice:
    low, high = (end / INCH for end in (probe.impact_position.min(), probe.impact_position.max()))
    most = "" if allowed is None else f"; allowed: {allowed:.1e}"
    again = ", larger where a second contact begins or ends" if choice.meets_again else ""
    accuracy = f"error of e_A up to {choice.error:.1e} at {low:.4g} to {high:.4g} in from the tip"
    return replace(
        choice, reason=f"{choice.label.removesuffix(',')}, {why}: {accuracy}{again}{most}"
    )


def _with_surrogate(choice: Choice, probe: Scenes, box: Box, standard_uncertainty: float) -> Choice:
    error, allowed = choice.error + PROBING.surrogate_tolerance, SHARE * standard_uncertainty
    if not isinstance(choice.model, ModalModel) or error > allowed:
        return choice
    try:
        surrogate = Surrogate.build(choice.model, box, tolerance=PROBING.surrogate_tolerance)
    except InputError as refused:
        return replace(choice, reason=f"{choice.reason}; no surrogate: {refused}")
    label = f"surrogate of {choice.label}"
    faster = replace(choice, label=label, error=error, surrogate=surrogate)
    return _because(faster, FASTEST, probe, allowed)


def _check(name: str | None, uncertainty: float | None) -> None:
    if name is not None and name not in COLLISION_MODELS:
        raise InputError("collision", "model", name, f"allowed: {', '.join(COLLISION_MODELS)}")
    if uncertainty is not None and not uncertainty > 0:
        raise InputError("collision", "standard_uncertainty", uncertainty, "allowed: above 0")


class CollisionLaw(Protocol):
    """The collision of a bat and balls in the form that the rigs of a test use."""

    def __call__(self, body: BatBody, support: Support) -> CollisionModel:
        """Return the collision model of an individual bat with its support."""
        ...

    def efficiencies(
        self, struck: Iterable[StruckBat], support: Support, scenes: Scenes
    ) -> NDArray[np.float64]:
        """Return e_A of the scenes, (n,), if nothing else of the collisions is needed."""
        ...

    def true_efficiencies(
        self, struck: Iterable[StruckBat], support: Support, scenes: Scenes
    ) -> NDArray[np.float64]:
        """Return the true e_A of the scenes, (n,)."""
        ...

    def report(self) -> ModelUsed:
        """Return the model that is used, its error of e_A and the reason."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Ladder:
    """The collision models of one test. The model is chosen once, for the nominal bat.

    The choice therefore depends only on the setup, and all tests of one setup share it. The result
    of a scene depends only on its bat, support and scene, not on other scenes.
    """

    nominal: BatBody
    support: Support  # support of the nominal bat
    probe: Scenes
    standard_uncertainty: float | None  # u of e_A in the test; None selects the modal model
    model_name: str | None = None
    box: Box | None = None  # range of the scenes for a surrogate; None: no surrogate is built
    chosen: list[Choice] = field(default_factory=list)  # the choice, empty until first used
    fitted: dict[tuple[BatBody, Support], Choice] = field(default_factory=dict)

    def with_box(self, box: Box) -> Ladder:
        """Return the ladder for very many scenes within `box`, if only their e_A is needed."""
        return replace(self, box=box, fitted={})

    @property
    def choice(self) -> Choice:
        """The chosen model, its error for individuals of the nominal bat, and the reason."""
        if not self.chosen:
            u = self.standard_uncertainty
            self.chosen.append(
                choose(
                    self.nominal,
                    self.support,
                    self.probe,
                    model_name=self.model_name,
                    standard_uncertainty=u,
                )
            )
        return self.chosen[0]

    def __call__(self, body: BatBody, support: Support) -> CollisionModel:
        """Return the collision model of an individual bat with its support."""
        return self.choice.of(body, support).model

    def efficiencies(
        self, struck: Iterable[StruckBat], support: Support, scenes: Scenes
    ) -> NDArray[np.float64]:
        """Return e_A of the scenes, (n,), by the fastest accurate method."""
        u, box = self.standard_uncertainty, self.box
        if self.model_name is not None or u is None or box is None:
            return _together([(self(body, support), shots) for body, shots in struck], scenes)
        e_A = np.empty(len(scenes))
        for body, shots in struck:
            if (body, support) not in self.fitted:
                choice = self.choice.of(body, support)
                self.fitted[body, support] = _with_surrogate(choice, self.probe, box, u)
            e_A[shots] = self.fitted[body, support].efficiency(scenes.part(shots))
        return e_A

    def true_efficiencies(
        self, struck: Iterable[StruckBat], support: Support, scenes: Scenes
    ) -> NDArray[np.float64]:
        """Return the true e_A of the scenes, (n,).

        The model is the model of the shots, or its surrogate. If the shots use the rigid model, the
        modal model is used instead.
        """
        if self.box is not None and self.model_name is None:
            return self.efficiencies(struck, support, scenes)
        models = [(self._true(body, support), shots) for body, shots in struck]
        return _together(models, scenes)

    def _true(self, body: BatBody, support: Support) -> CollisionModel:
        model = self(body, support)
        return ModalModel.of(body, support) if isinstance(model, RigidModel) else model

    def report(self) -> ModelUsed:
        """Return the model that is used, or its surrogate, with its error of e_A and the reason."""
        model_choice = next(iter(self.fitted.values()), None) or self.choice
        return ModelUsed(
            rung=model_choice.model_name, error=model_choice.error, reason=model_choice.reason
        )


def _together(models: Sequence[tuple[CollisionModel, Shots]], scenes: Scenes) -> Array:
    """Return e_A of the scenes of several models, (n,). Modal models are integrated together."""
    e_A = np.empty(len(scenes))
    stepped = [(one, shots) for one, shots in models if isinstance(one, ModalModel)]
    if len(stepped) > 1:
        batch = [(one, scenes.part(shots)) for one, shots in stepped]
        for (_, shots), collisions in zip(stepped, collide_bats(batch), strict=True):
            e_A[shots] = collisions.collision_efficiency
        models = [each for each in models if not isinstance(each[0], ModalModel)]
    for one, shots in models:
        e_A[shots] = one.collide(scenes.part(shots)).collision_efficiency
    return e_A


def probing_scenes(
    ball: BallSpec, speed: float, places: tuple[float, float] = PROBING.places
) -> Scenes:
    """Return the scenes that measure the error of a collision model, one per impact position.

    In each scene the nominal ball hits the bat. The ball-wall restitution is the e0 of the ball at
    the relative speed. The impact positions are about `PROBING.every` apart. They always cover the
    range `PROBING.places`.

    Parameters
    ----------
    ball
        Data sheet of the ball.
    speed
        Relative speed of ball and bat [m/s].
    places
        Lowest and highest distance from the tip [m]. The positions cover this range in addition to
        `PROBING.places`.

    Raises
    ------
    InputError
        A position is negative. Or the speed is not positive, not finite, or above 1e6 m/s.
    """
    low, high = min(places[0], PROBING.places[0]), max(places[1], PROBING.places[1])
    count = round((high - low) / PROBING.every) + 1
    return Scenes.with_ball(
        ball, impact_position=np.linspace(low, high, count), relative_speed=speed
    )
