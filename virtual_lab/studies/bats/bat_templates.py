"""Fit of a bat model to measurements, by least squares over the parameters of a template.

A template is a shape with a few parameters, each with a typical value, a typical spread and limits.
The fit agrees with each measurement within its uncertainty. As far as the data allow, the
parameters stay near a target: their typical values, or random values drawn from the spread. Fits
with many random targets, each to data varied by their uncertainties, show the remaining
uncertainty.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from typing import Annotated, Literal, NamedTuple

import numpy as np
from annotated_types import Gt, MaxLen
from scipy.optimize import least_squares

from virtual_lab.catalog.specs import (
    LONGEST,
    SHORTEST,
    BatBody,
    Construction,
    Dimension,
    HoopMode,
    Lump,
    Material,
    Name,
    Profile,
    Spec,
    Sport,
    Title,
)
from virtual_lab.errors import InputError
from virtual_lab.simulation.physics.beam import Free, beam_of
from virtual_lab.simulation.physics.modes import barrel_nodes, modes_of
from virtual_lab.simulation.physics.shell import shell_mode
from virtual_lab.units import INCH, OUNCE, Array

HOOP_POSITION = 6 * INCH  # position at which the modal mass is stated, near the largest e [m]
PLAUSIBLE_SHARES = (0.5, 2.0)  # limits of a measured modal mass [modal mass of a shell]
COARSE = {"order": 6, "element_size": 0.1}  # relative error of the first two frequencies: 1e-6


GOALS = {  # fields that are fitted, and the names of their values
    "mass": "mass",
    "z_cm": "z_cm",
    "inertia": "inertia",
    "bending_frequencies": "f{}",
    "barrel_nodes": "node{}",
    "hoop_frequency": "hoop frequency",
    "hoop_modal_mass": "hoop modal mass",
}
MEASURED = ("length", "inertia_axis", *GOALS)  # fields with an uncertainty


class Goal(NamedTuple):
    """A measured value [SI] and its standard uncertainty, 0 if the fit must be close to it."""

    value: float
    u: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BatMeasurements(Spec):
    """Measurements of a bat by a user. Positions are distances from the barrel tip.

    Fields ending in `_u` are standard uncertainties; 0 means that the fit must reproduce the value
    closely.
    """

    name: Name
    title: Title
    template: Literal["wood", "hollow"]
    sport: Sport | None = None
    construction: Construction | None = None
    length: Annotated[float, Dimension("length", SHORTEST, LONGEST)]
    mass: Annotated[float, Dimension("mass", 0.1, 5)]
    z_cm: Annotated[float, Gt(0), Dimension("length", 0, LONGEST)]  # balance point
    inertia: Annotated[float, Gt(0), Dimension("inertia", 0, 10)]
    # axis of the moment of inertia, from the tip
    inertia_axis: Annotated[float, Dimension("length", -LONGEST, 2 * LONGEST)]
    bending_frequencies: Annotated[tuple[float, ...], MaxLen(2), Dimension("frequency")] = ()
    barrel_nodes: Annotated[tuple[float, ...], MaxLen(2), Dimension("length")] = ()
    hoop_frequency: Annotated[float | None, Dimension("frequency", 10, 1e5)] = None
    hoop_modal_mass: Annotated[float | None, Dimension("mass", 1e-4, 5)] = None
    length_u: Annotated[float, Dimension("length", 0, LONGEST)] = 0.0
    mass_u: Annotated[float, Dimension("mass", 0, 5)] = 0.0
    z_cm_u: Annotated[float, Dimension("length", 0, LONGEST)] = 0.0
    inertia_u: Annotated[float, Dimension("inertia", 0, 10)] = 0.0
    inertia_axis_u: Annotated[float, Dimension("length", 0, LONGEST)] = 0.0
    bending_frequencies_u: Annotated[tuple[float, ...], Dimension("frequency", 0, 1e5)] = ()
    barrel_nodes_u: Annotated[tuple[float, ...], Dimension("length", 0, LONGEST)] = ()
    hoop_frequency_u: Annotated[float, Dimension("frequency", 0, 1e5)] = 0.0
    hoop_modal_mass_u: Annotated[float, Dimension("mass", 0, 5)] = 0.0

    def __post_init__(self) -> None:
        if not self.z_cm < self.length:
            raise ValueError(
                f"z_cm of {self.z_cm:g} m is outside a bat with the length of {self.length:g} m"
            )
        least = self.mass * (self.inertia_axis - self.z_cm) ** 2
        if not self.inertia > least:
            raise ValueError(
                f"inertia of {self.inertia:g} kg m^2 is less than mass times the square of the "
                f"distance from balance point to axis, {least:g} kg m^2"
            )
        if any(not f > 0 for f in self.bending_frequencies):
            raise ValueError("bending_frequencies must be above 0")
        if any(high <= low for low, high in pairwise(self.bending_frequencies)):
            raise ValueError("bending_frequencies must increase")
        if any(not 0 < node < self.length for node in self.barrel_nodes):
            raise ValueError("barrel_nodes must lie on the bat")
        for name in ("bending_frequencies", "barrel_nodes"):
            values, u = getattr(self, name), getattr(self, f"{name}_u")
            if u and len(u) != len(values):
                raise ValueError(f"{name}_u has {len(u)} values where {name} has {len(values)}")
        for name in ("hoop_frequency", "hoop_modal_mass"):
            if getattr(self, name) is not None and self.template == "wood":
                raise ValueError(f"{name} belongs to a hollow bat; a wood bat has no hoop mode")
            if getattr(self, name) is None and getattr(self, f"{name}_u"):
                raise ValueError(f"{name}_u requires {name}")

    @property
    def goals(self) -> dict[str, Goal]:
        """Measured quantities to fit, keyed by name [SI]. The length is not fitted."""
        return {
            name.format(i): goal
            for field, name in GOALS.items()
            for i, goal in enumerate(self._values(field), start=1)
        }

    def vary(self, draws: Array) -> BatMeasurements:
        """Return the measurements plus `draws` of their uncertainties, one row per `MEASURED`.

        Raises `ValueError` if the varied values contradict one another.
        """
        values: dict[str, float | tuple[float, ...]] = {}
        for field, draw in zip(MEASURED, draws, strict=True):
            varied = tuple(
                value + u * float(x)
                for (value, u), x in zip(self._values(field), draw, strict=False)
            )
            if varied:
                values[field] = varied if isinstance(getattr(self, field), tuple) else varied[0]
        return replace(self, **values)  # type: ignore[arg-type]

    def _values(self, field: str) -> list[Goal]:
        """Return the values of a field with their uncertainties; none if it was not measured."""
        value, u = getattr(self, field), getattr(self, f"{field}_u")
        if isinstance(value, tuple):
            return [Goal(*pair) for pair in zip(value, u or (0.0,) * len(value), strict=True)]
        return [] if value is None else [Goal(value, u)]


class Parameter(NamedTuple):
    """A parameter of a template [SI]: typical value, typical spread, and limits."""

    name: str
    usual: float
    spread: float
    low: float
    high: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Template:
    """A family of bats with a few parameters."""

    parameters: tuple[Parameter, ...]
    build: Callable[[Array, float], BatBody]  # function of the parameters and the length [m]

    @property
    def usual(self) -> Array:
        return np.array([parameter.usual for parameter in self.parameters])

    @property
    def spread(self) -> Array:
        return np.array([parameter.spread for parameter in self.parameters])


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyFit:
    """A fitted bat, its parameters and its misfits."""

    body: BatBody
    parameters: Array
    misfits: dict[str, float]  # computed minus measured: relative, for nodes in m


def fit(measured: BatMeasurements, target: Array | None = None) -> BodyFit:
    """Return a bat that fits the measurements, with parameters close to `target`.

    The bat is built from a template, a family of bats with a few free parameters. The result holds
    the bat, its parameters, and the misfit of each measurement. A misfit is the computed value
    minus the measured value. It is relative to the measured value, or in meters for a node.

    Parameters
    ----------
    measured
        The measurements. They also name the template.
    target
        Preferred parameters of the template in SI, (parameter,). Values beyond the template's
        limits are moved to the limits. By default the typical parameters of the template.

    Raises
    ------
    InputError
        No bat of the template fits each measurement within its tolerance. The tolerance is 3 u or
        0.1 % (0.05 in for a node), whichever is more. The message lists the misfits of the best
        fit.
    """
    template = TEMPLATES[measured.template]
    usual, spread = template.usual, template.spread
    low, high = (np.array([(p.low, p.high) for p in template.parameters]).T - usual) / spread
    near = np.clip(np.zeros_like(usual) if target is None else (target - usual) / spread, low, high)

    def residuals(x: Array) -> Array:  # x: deviation from the typical values [spreads]
        misfits = _misfits(template.build(usual + spread * x, measured.length), measured)
        data = [value / max(_weight(name), _u(name, measured)) for name, value in misfits.items()]
        return np.concatenate((data, x - near))

    def jacobian(x: Array) -> Array:
        width = 1e-4  # step [spreads], large compared with rounding errors of the frequencies
        middle, steps = residuals(x), np.where(x + width > high, -width, width)
        return np.stack([residuals(x + step) - middle for step in np.diag(steps)], axis=1) / steps

    tolerance = 1e-5  # relative to a cost of about 1 if the data are fitted
    search = partial(
        least_squares, jac=jacobian, bounds=(low, high), ftol=tolerance, xtol=tolerance
    )
    # fast, but not along a curved valley, where the default method is faster
    x = search(residuals, near, method="dogbox", max_nfev=10).x
    x = search(residuals, x, max_nfev=60).x
    parameters = usual + spread * x
    body = template.build(parameters, measured.length)
    misfits = _misfits(body, measured)
    missed = {
        name: value
        for name, value in misfits.items()
        if abs(value) > max(_tolerance(name), 3 * _u(name, measured))
    }
    if missed:
        allowed = (
            "no bat of this template fits the data; positions count from the barrel tip: subtract "
            f"those from the knob from the length; misfit of the best one: {_misfit_words(missed)}"
        )
        raise InputError(measured.name, "template", measured.template, allowed)
    return BodyFit(body=body, parameters=np.asarray(parameters), misfits=misfits)


def compute_quantities(
    body: BatBody, axis: float, *, frequencies: int, nodes: int
) -> dict[str, float]:
    """Return quantities of a bat in SI units, keyed by the names in `BatMeasurements.goals`.

    The quantities are mass, z_cm (balance point from the tip), inertia about `axis`, bending
    frequencies f1, f2, … of the free bat [Hz], and barrel nodes node1, node2, … [m from the tip].

    Parameters
    ----------
    body
        The bat.
    axis
        Axis of the moment of inertia [m from the tip].
    frequencies, nodes
        Numbers of bending frequencies and of nodes to compute; 0 for none.
    """
    beam = beam_of(body, Free(), **COARSE)  # type: ignore[arg-type]  # elements as for the modes
    values = {"mass": beam.mass, "z_cm": beam.z_cm, "inertia": beam.inertia(axis)}
    count = max(frequencies, nodes)
    if count:
        modes = modes_of(body, Free(), count, **COARSE)
        bending = modes.bending_frequencies[:frequencies]
        values |= {f"f{i + 1}": float(f) for i, f in enumerate(bending)}
        places = barrel_nodes(modes, nodes) if nodes else ()
        values |= {f"node{i + 1}": node for i, node in enumerate(places)}
    return values


def hoop_quantities(body: BatBody) -> dict[str, float]:
    """Return frequency [Hz] and modal mass [kg] of the hoop mode of a bat.

    The keys are ``hoop frequency`` and ``hoop modal mass``, as in `BatMeasurements.goals`. The
    result is empty for a bat without a hoop mode.
    """
    if body.hoop is None:
        return {}
    return {"hoop frequency": body.hoop.frequency, "hoop modal mass": body.hoop.modal_mass}


def require_plausible_hoop(measured: BatMeasurements) -> None:
    """Raise `InputError` if a measured modal mass of the hoop mode is implausible.

    A bat model is fitted to all other measurements. The modal mass is computed for a shell with the
    outline and wall of this model. The measured modal mass is implausible if it is less than half
    or more than twice the computed one. `InputError` is also raised if no model fits the other
    measurements. Nothing is raised if no modal mass was measured.
    """
    mass = measured.hoop_modal_mass
    if mass is None:
        return
    others = replace(measured, hoop_modal_mass=None, hoop_modal_mass_u=0.0)
    low, high = (share * shell_mode(fit(others).body).modal_mass for share in PLAUSIBLE_SHARES)
    if not low <= mass <= high:
        allowed = (
            f"allowed: {low:.3f} to {high:.3f} kg, half to twice the modal mass of a shell with "
            "this bat's outline and wall"
        )
        raise InputError(measured.name, "hoop_modal_mass", f"{mass:g} kg", allowed)


def _misfits(body: BatBody, measured: BatMeasurements) -> dict[str, float]:
    values = compute_quantities(
        body,
        measured.inertia_axis,
        frequencies=len(measured.bending_frequencies),
        nodes=len(measured.barrel_nodes),
    ) | hoop_quantities(body)
    return {
        name: values[name] - goal.value
        if name.startswith("node")
        else values[name] / goal.value - 1
        for name, goal in measured.goals.items()
    }


def _misfit_words(misfits: dict[str, float]) -> str:
    """Return the misfits as text, the largest first."""
    worst_first = sorted(misfits, key=lambda name: -abs(misfits[name]) / _tolerance(name))
    return ", ".join(
        f"{name} by {misfits[name] / INCH:+.2f} in"
        if name.startswith("node")
        else f"{name} by {100 * misfits[name]:+.1f} %"
        for name in worst_first
    )


def _u(name: str, measured: BatMeasurements) -> float:
    """Return the standard uncertainty of a measured value, relative, or in m for a node."""
    goal = measured.goals[name]
    return goal.u if name.startswith("node") else goal.u / goal.value


def _weight(name: str) -> float:
    """Return the misfit that counts as much as a parameter one typical spread away from its target.

    It is relative, or in m for a node.
    """
    return 1e-3 * INCH if name.startswith("node") else 1e-4


def _tolerance(name: str) -> float:
    """Return the largest accepted misfit, relative, or in m for a node."""
    return 0.05 * INCH if name.startswith("node") else 1e-3


def _wood(x: Array, length: float) -> BatBody:
    barrel, tip, handle, start, end, middle, knob, density, modulus, ratio = map(float, x)
    between = handle + middle * (barrel - handle)
    z = (0.0, 0.06, start, (start + end) / 2, end)
    return BatBody(
        profile=Profile(
            z=(*(part * length for part in z), length - 2 * INCH, length - 0.8 * INCH, length),
            outer_diameter=(tip * barrel, barrel, barrel, between, handle, handle, knob, knob),
        ),
        material=Material(
            density=density,
            youngs_modulus=modulus,
            shear_modulus=modulus / ratio,
            shear_coefficient=0.9,
        ),
        damping_ratio=0.003,
    )


def _hollow(x: Array, length: float) -> BatBody:
    barrel, handle, start, end, middle, *others = map(float, x)
    wall, wall_middle, wall_handle, knob, knob_position, cap, frequency_ratio, mass_ratio = others
    between = handle + middle * (barrel - handle)
    body = BatBody(
        profile=Profile(
            z=tuple(part * length for part in (0.0, start, (start + end) / 2, end, 1.0)),
            outer_diameter=(barrel, barrel, between, handle, handle),
            wall=(wall, wall, wall_middle, wall_handle, wall_handle),
        ),
        material=Material(
            density=2820.0, youngs_modulus=71.5e9, shear_modulus=26.9e9, shear_coefficient=0.5
        ),
        damping_ratio=0.001,
        lumps=(
            Lump(name="end cap", z=0.02 * length, mass=cap),
            Lump(name="knob", z=knob_position * length, mass=knob),
        ),
    )
    shell = shell_mode(body)
    mass = np.interp(HOOP_POSITION, shell.z, shell.modal_masses)
    hoop = HoopMode(frequency=frequency_ratio * shell.frequency, modal_mass=mass_ratio * mass)
    return replace(body, hoop=hoop)


TEMPLATES: dict[str, Template] = {
    "wood": Template(
        parameters=(
            Parameter("barrel diameter", 2.5 * INCH, 0.06 * INCH, 2.2 * INCH, 2.75 * INCH),
            Parameter("tip over barrel diameter", 0.93, 0.03, 0.75, 1.0),
            Parameter("handle diameter", 1.02 * INCH, 0.06 * INCH, 0.8 * INCH, 1.4 * INCH),
            Parameter("taper starts, of the length", 0.20, 0.04, 0.1, 0.38),
            Parameter("taper ends, of the length", 0.62, 0.05, 0.45, 0.85),
            Parameter("middle of the taper", 0.45, 0.05, 0.25, 0.75),
            Parameter("knob diameter", 1.85 * INCH, 0.12 * INCH, 1.4 * INCH, 2.3 * INCH),
            Parameter("density", 650.0, 50.0, 450.0, 850.0),
            Parameter("Young's modulus", 15e9, 2e9, 8e9, 25e9),
            Parameter("Young's over shear modulus", 16.0, 2.0, 10.0, 25.0),
        ),
        build=_wood,
    ),
    "hollow": Template(
        parameters=(
            Parameter("barrel diameter", 2.55 * INCH, 0.06 * INCH, 2.2 * INCH, 2.75 * INCH),
            Parameter("handle diameter", 0.92 * INCH, 0.04 * INCH, 0.78 * INCH, 1.1 * INCH),
            Parameter("taper starts, of the length", 0.22, 0.04, 0.1, 0.4),
            Parameter("taper ends, of the length", 0.66, 0.05, 0.45, 0.85),
            Parameter("middle of the taper", 0.45, 0.05, 0.25, 0.75),
            Parameter("wall of the barrel", 2.8e-3, 0.4e-3, 1.2e-3, 5e-3),
            Parameter("wall in the taper", 2.8e-3, 0.4e-3, 1.2e-3, 6e-3),
            Parameter("wall of the handle", 2.5e-3, 0.4e-3, 1.2e-3, 6e-3),
            Parameter("knob mass", 2.0 * OUNCE, 1.0 * OUNCE, 0.2 * OUNCE, 10 * OUNCE),
            Parameter("knob place, of the length", 0.97, 0.015, 0.9, 1.0),
            Parameter("end cap mass", 0.8 * OUNCE, 0.5 * OUNCE, 0.1 * OUNCE, 5 * OUNCE),
            # Frequency and modal mass relative to a shell with this wall and a rigid cap are 1.26
            # and 1 for EA70, and 1 and 1 for softball-34.
            Parameter("hoop frequency over that of the shell", 1.1, 0.15, 0.5, 2.0),
            Parameter("hoop modal mass over that of the shell", 1.0, 0.1, 0.5, 2.0),
        ),
        build=_hollow,
    ),
}
