"""A procedure as data: the keys of ``data/procedures/*.toml``, checked on reading."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Le, Len
from numpy.typing import ArrayLike, NDArray

from virtual_lab.catalog.specs import Dimension, Name, Spec, Sport, Title, YesNo
from virtual_lab.measurement.reduction.shot_algebra import ReductionSettings
from virtual_lab.output.metrics import METRICS
from virtual_lab.units import INCH

if TYPE_CHECKING:
    Metric = str
else:  # names of all metrics, checked on reading
    Metric = Literal[tuple(METRICS)]
MOST_COUNTED = 1000  # largest allowed count of anything; a larger one is a typing error
SETTING_STEP = 0.5e-3  # step in which the operator sets an impact position [m]
OPTIONAL_WINDOWS = (
    "place_tolerance",
    "rate_before",
    "recoil_u",
    "bat_speed_tolerance",
    "contact_angle",
    "edge_misfit",
    "rebound_angle",
    "agreement",
)
Mass = Annotated[float, Gt(0), Dimension("mass")]
Length = Annotated[float, Gt(0), Dimension("length")]
SPEED = Dimension("speed", 1, 100)  # speed of a ball or a bat [m/s]
Speed = Annotated[float, SPEED]
Number = Annotated[float, Gt(0), Dimension("number")]
Count = Annotated[int, Dimension("number", 2, MOST_COUNTED)]


def _require_positive(spec: Spec, *names: str) -> None:
    """Raise an error for numbers in optional fields that are not positive."""
    for name in names:
        value = getattr(spec, name)
        if value is not None and not value > 0:
            raise ValueError(f"{name} is {value:g}; it must be greater than 0, or left out")


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows(Spec):
    """Acceptance windows for a hit. A window that is None is not applied."""

    speed_tolerance: Annotated[float, Gt(0), Dimension("speed")]
    ball_mass_low: Mass
    ball_mass_high: Mass
    ball_restitution_low: Number
    ball_restitution_high: Number
    ball_restitution_speed: Speed  # speed to which the two limits above refer
    place_tolerance: Annotated[float | None, Dimension("length")] = None
    rate_before: Annotated[float | None, Dimension("angular speed")] = None
    recoil_u: Annotated[float | None, Dimension("number")] = None  # relative u of one recoil fit
    bat_speed_tolerance: Annotated[float | None, Dimension("speed")] = None
    contact_angle: Annotated[float | None, Dimension("angle")] = None  # angle of a swung bat
    edge_misfit: Annotated[float | None, Dimension("length")] = None  # rms misfit at a board
    rebound_angle: Annotated[float | None, Dimension("angle")] = None
    agreement: Annotated[float | None, Dimension("number")] = None  # e_A by recoil and by rebound

    def __post_init__(self) -> None:
        _require_positive(self, *OPTIONAL_WINDOWS)
        for name in ("ball_mass", "ball_restitution"):
            low, high = getattr(self, f"{name}_low"), getattr(self, f"{name}_high")
            if low > high:
                raise ValueError(f"{name}_low {low:g} is above {name}_high {high:g}: no ball fits")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan(Spec):
    """Scan along the barrel: coarse steps, then fine ones until a maximum is bracketed."""

    low: Length  # distance from the tip
    high: Length
    coarse_step: Length
    fine_step: Length
    coarse_hits: Annotated[int, Dimension("number", 1, MOST_COUNTED)]
    # half width of the fitted range around the best position; twice this range shows its bend
    fit_half_width: Length
    # number of final hits at the best position; 0: the maximum of the fitted curve is the result
    final_hits: Annotated[int, Dimension("number", 0, MOST_COUNTED)]
    consecutive: YesNo = False  # whether an invalid shot restarts the final hits
    # quantity with its maximum at the best position: the metric, or v_f at the test's own speeds
    seeks: Literal["metric", "batted_speed"] = "metric"
    # drop of the metric from its maximum that defines the stated width; None: no width
    width_drop: Annotated[float | None, Dimension("number")] = None

    def __post_init__(self) -> None:
        _require_positive(self, "width_drop")
        if self.high - self.low < 2 * self.coarse_step - 1e-9:  # rounding [m]
            raise ValueError(
                f"a scan from {self.low:g} to {self.high:g} m is too short for two steps "
                f"of {self.coarse_step:g} m"
            )
        if self.fine_step < 2 * SETTING_STEP:
            raise ValueError(
                f"fine_step is {self.fine_step:g} m; allowed: at least {2 * SETTING_STEP:g} m, "
                f"because impact positions are set in steps of {SETTING_STEP:g} m"
            )
        if self.fine_step > self.coarse_step:
            raise ValueError("fine_step is larger than coarse_step")
        if self.fit_half_width < self.fine_step:
            raise ValueError("fit_half_width is smaller than fine_step, so no curve can be fitted")


@dataclass(frozen=True, slots=True, kw_only=True)
class Game(Spec):
    """Game conditions: pitch and swing for the conversion of e_A to v_f, Eqs. (3), (13), (14).

    The swing of the reference bat is a rotation (`angular_speed` about `axis_from_knob`) or one
    `bat_speed` at every position. For another bat it is multiplied by (reference / own)^exponent,
    the ratio of the two bats' inertias or masses (`scales_with`).
    """

    pitch_speed: Speed
    scales_with: Literal["inertia", "mass"]  # inertia about the axis of the swing
    exponent: Annotated[float, Ge(0), Dimension("number")]
    # further exponents for which the certificate states the result
    exponents: Annotated[tuple[float, ...], Dimension("number")] = ()
    reference_inertia: Annotated[float | None, Dimension("inertia")] = None
    reference_mass: Annotated[float | None, Dimension("mass")] = None
    axis_from_knob: Annotated[float | None, Dimension("length")] = None
    angular_speed: Annotated[float | None, Dimension("angular speed")] = None
    bat_speed: Annotated[float | None, Dimension("speed")] = None

    def __post_init__(self) -> None:
        _require_positive(self, "angular_speed", "bat_speed", "reference_inertia", "reference_mass")
        if (self.angular_speed is None) == (self.bat_speed is None):
            raise ValueError("a swing needs either angular_speed or bat_speed, not both")
        if self.angular_speed is not None and self.axis_from_knob is None:
            raise ValueError("axis_from_knob is missing; angular_speed needs the axis of the swing")
        if getattr(self, f"reference_{self.scales_with}") is None:
            raise ValueError(f"reference_{self.scales_with} is missing")


@dataclass(frozen=True, slots=True, kw_only=True)
class BallCorrection(Spec):
    """Correction for balls that differ from the standard ball.

    `none`: no correction. `ratio`: e is proportional to e0, which is exact for a rigid body.
    `trampoline`: the stiffness ratio of shell and ball follows from e and e0, and gives e with the
    standard ball. Both leave out the vibration of the bat. `control-bat`: e is proportional to the
    result of a bat of known e with the same lot.
    """

    method: Literal["none", "ratio", "trampoline", "control-bat"]
    # e0 of the standard ball, the same at every speed, or known e of the control bat
    standard: Number


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditioning(Spec):
    """Relative humidity of the store in which balls are conditioned, 0 to 1."""

    humidity: Annotated[float, Ge(0), Le(1), Dimension("number")]
    tolerance: Annotated[float, Gt(0), Le(1), Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Eligibility(Spec):
    """Requirements on a bat before the first hit. A requirement that is None is not applied."""

    length_less_weight: Annotated[float | None, Dimension("number")] = None  # inches minus ounces
    greatest_length: Annotated[float | None, Dimension("length")] = None
    barrel_diameter: Annotated[float | None, Dimension("length")] = None  # diameter of a ring gauge
    inertia_lengths: Annotated[tuple[float, ...], Dimension("length")] = ()
    inertia_floors: Annotated[tuple[float, ...], Dimension("inertia")] = ()  # about the pivot
    exempt: Title | None = None  # bats that need no test, such as "one-piece wood bats"

    def __post_init__(self) -> None:
        if len(self.inertia_lengths) != len(self.inertia_floors):
            raise ValueError(
                f"{len(self.inertia_floors)} inertia_floors but {len(self.inertia_lengths)} "
                "inertia_lengths; both lists need the same length"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Procedure(Spec):
    """The parts of a test procedure that rig and reduction need."""

    name: Name
    title: Title
    edition: Title
    rig: str
    ball: str
    reads: Literal["recoil", "rebound"]  # reading from which e_A is computed
    recoil: Literal["pivoted", "free"]  # support whose r is used in Eq. (6)
    metric: Metric
    place: Literal["centre-of-percussion", "scan"]
    pivot_from_knob: Length
    ball_speed: Speed
    valid_hits: Count  # number of hits per impact position
    attempts: Count
    balls: Count
    wall_hits: Count  # number of hits per ball and speed
    wall_speeds: Annotated[tuple[float, ...], Len(1, 20), SPEED]
    windows: Windows
    sport: Sport | None = None  # None: any bat and ball
    bat_speed: Annotated[float | None, SPEED] = None  # speed 6 in from the tip; None: bat at rest
    limit: Annotated[float | None, Dimension("number")] = None
    speed_limit: Annotated[float | None, Dimension("speed")] = None  # limit of the batted ball
    # largest standard uncertainty of the metric for which the result gives a verdict
    largest_u: Annotated[float | None, Dimension("number")] = None
    # the same for the speed of a batted ball
    largest_speed_u: Annotated[float | None, Dimension("speed")] = None
    # smallest share of the balls of a box within the windows; with fewer, another box is opened
    least_admitted: Annotated[float, Ge(0), Le(1), Dimension("number")] = 0.0
    # slope of e_A along the barrel for tests at one position: mean and spread over suitable bats
    place_slope: Annotated[float, Dimension("slope of length")] = 0.0
    place_slope_u: Annotated[float, Ge(0), Dimension("slope of length")] = 0.0
    scan: Scan | None = None
    game: Game | None = None
    correction: BallCorrection | None = None
    eligibility: Eligibility | None = None
    conditioning: Conditioning | None = None

    def __post_init__(self) -> None:
        _require_positive(self, "limit", "speed_limit", "largest_u", "largest_speed_u")
        if self.attempts < self.valid_hits:
            impossible = f"{self.attempts} attempts cannot give {self.valid_hits} valid hits"
            raise ValueError(f"{impossible}; change attempts too")
        if (self.place == "scan") != (self.scan is not None):
            raise ValueError("place = 'scan' needs a table [scan], and [scan] needs place = 'scan'")
        if self.scan is not None and (self.place_slope or self.place_slope_u):
            raise ValueError("place_slope applies to a test at one impact position, not to a scan")
        if self.scan is not None and self.scan.coarse_hits > self.valid_hits:
            raise ValueError(
                f"scan.coarse_hits is {self.scan.coarse_hits}; allowed: up to valid_hits, "
                f"{self.valid_hits}"
            )
        if self.reads == "recoil" and self.bat_speed is not None:
            raise ValueError("reads = 'recoil' needs a bat at rest; leave out bat_speed")
        self._require_keys_of_the_metric()
        self._require_what_is_sought()
        if self.scan is not None and self.scan.width_drop and self.metric == "batted_speed":
            raise ValueError(
                "scan.width_drop has no unit, so it does not apply to the metric batted_speed"
            )

    def _require_keys_of_the_metric(self) -> None:
        numbers, speeds = ("limit", "largest_u"), ("speed_limit", "largest_speed_u")
        is_speed = METRICS[self.metric].si_unit == "m/s"
        required, others = (speeds, numbers) if is_speed else (numbers, speeds)
        for right, wrong in zip(required, others, strict=True):
            if getattr(self, wrong) is not None:
                raise ValueError(f"{wrong} does not apply to the metric {self.metric}; use {right}")
        if getattr(self, required[1]) is None:
            raise ValueError(
                f"{required[1]} is missing: the largest u of the metric in a valid test"
            )

    def _require_what_is_sought(self) -> None:
        scan = self.scan
        if scan is None or scan.seeks == "metric":
            return
        if self.metric != "besr" or self.game is not None:
            raise ValueError("scan.seeks = 'batted_speed' needs the metric besr without [game]")
        if scan.final_hits or scan.width_drop:
            raise ValueError(
                "scan.seeks = 'batted_speed' uses the maximum of the fitted curve; set final_hits "
                "to 0 and leave out width_drop"
            )

    @property
    def metric_limit(self) -> float | None:
        """Limit of the metric [SI], None if the rules set none."""
        return self.limit if self.speed_limit is None else self.speed_limit

    @property
    def largest_metric_u(self) -> float:
        """Largest standard uncertainty of the metric for which the result gives a verdict [SI]."""
        return self.largest_u or self.largest_speed_u or 0.0

    @property
    def as_found(self) -> Procedure:
        """The procedure without its correction for the balls."""
        return replace(self, correction=None)

    @property
    def normalized(self) -> bool:
        """Whether the metric is converted to another ball than the balls of the lot."""
        return self.correction is not None and self.correction.method != "none"

    @property
    def standard_restitution(self) -> float | None:
        """e0 of the standard ball to which the metric is converted; None: to none."""
        correction = self.correction
        if correction is None or correction.method not in ("ratio", "trampoline"):
            return None
        return correction.standard

    @property
    def controlled(self) -> bool:
        """Whether the correction for the balls uses a control bat."""
        return self.correction is not None and self.correction.method == "control-bat"

    @property
    def needs(self) -> frozenset[str]:
        """Channels that a rig must write for this procedure, besides one that times the balls."""
        recoil = {"encoder"} if self.reads == "recoil" else set()
        moving = {"swing"} if self.bat_speed is not None else set()
        return frozenset({"log"} | recoil | moving)

    def turn_rate(self, length: ArrayLike) -> NDArray[np.float64]:
        """Return the nominal angular speed [rad/s] of a bat of this length [m], 0 at rest."""
        length = np.asarray(length)
        return (self.bat_speed or 0.0) / (length - self.pivot_from_knob - 6 * INCH)

    @property
    def reduction_settings(self) -> ReductionSettings:
        """Settings of the reduction for this procedure."""
        return ReductionSettings(
            reads=self.reads,
            recoil=self.recoil,
            pivot_from_knob=self.pivot_from_knob,
            ball_speed=self.ball_speed,
            turn_rate=self.turn_rate,
            window_speed=self.windows.ball_restitution_speed,
        )
