"""A procedure as data: the keys of ``data/procedures/*.toml``, checked on reading."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
from annotated_types import Ge, Gt, Len
from numpy.typing import ArrayLike, NDArray

from virtual_lab.catalog.specs import Dimension, Name, Spec, Sport, Title, YesNo
from virtual_lab.measurement.reduction.shot_algebra import ReductionSettings
from virtual_lab.units import INCH

MOST_COUNTED = 1000  # of anything counted: beyond, a slip of the pen and no test
SETTING_STEP = 0.5e-3  # m, the operator sets a place to half a millimetre
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
Metric = Literal["bat_performance_factor", "besr", "restitution", "batted_speed"]
Mass = Annotated[float, Gt(0), Dimension("mass")]
Length = Annotated[float, Gt(0), Dimension("length")]
SPEED = Dimension("speed", 1, 100)  # m/s, of a ball cannon or a bat
Speed = Annotated[float, SPEED]
Number = Annotated[float, Gt(0), Dimension("number")]
Count = Annotated[int, Dimension("number", 2, MOST_COUNTED)]


def _require_positive(spec: Spec, *names: str) -> None:
    """Refuse numbers not above 0 in optional fields."""
    for name in names:
        value = getattr(spec, name)
        if value is not None and not value > 0:
            raise ValueError(f"{name} is {value:g}; it must be greater than 0, or left out")


@dataclass(frozen=True, slots=True, kw_only=True)
class Windows(Spec):
    """Acceptance windows for a hit; a missing window is not applied."""

    speed_tolerance: Annotated[float, Gt(0), Dimension("speed")]
    ball_mass_low: Mass
    ball_mass_high: Mass
    ball_restitution_low: Number
    ball_restitution_high: Number
    ball_restitution_speed: Speed  # at which the two above hold
    place_tolerance: Annotated[float | None, Dimension("length")] = None
    rate_before: Annotated[float | None, Dimension("angular speed")] = None
    recoil_u: Annotated[float | None, Dimension("number")] = None  # of one recoil fit, relative
    bat_speed_tolerance: Annotated[float | None, Dimension("speed")] = None
    contact_angle: Annotated[float | None, Dimension("angle")] = None  # of a swung bat
    edge_misfit: Annotated[float | None, Dimension("length")] = None  # rms at a board
    rebound_angle: Annotated[float | None, Dimension("angle")] = None
    agreement: Annotated[float | None, Dimension("number")] = None  # e_A, recoil and rebound

    def __post_init__(self) -> None:
        _require_positive(self, *OPTIONAL_WINDOWS)
        for name in ("ball_mass", "ball_restitution"):
            low, high = getattr(self, f"{name}_low"), getattr(self, f"{name}_high")
            if low > high:
                raise ValueError(f"{name}_low {low:g} is above {name}_high {high:g}: no ball fits")


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan(Spec):
    """Places along the barrel: coarse steps first, then fine ones until a maximum is bracketed."""

    low: Length  # from the tip
    high: Length
    coarse_step: Length
    fine_step: Length
    coarse_hits: Annotated[int, Dimension("number", 1, MOST_COUNTED)]
    fit_half_width: Length  # of the curve's piece that is fitted about the best place
    # 0: the top of the fitted curve
    final_hits: Annotated[int, Dimension("number", 0, MOST_COUNTED)]
    consecutive: YesNo = False  # an invalid shot among the final hits begins them again
    # what has its greatest value at the best place: the metric, or v_f at the test's own speeds
    seeks: Literal["metric", "batted_speed"] = "metric"
    # how far below its top the metric's curve still counts as near it; None: no width is stated
    width_drop: Annotated[float | None, Dimension("number")] = None

    def __post_init__(self) -> None:
        _require_positive(self, "width_drop")
        if self.high - self.low < 2 * self.coarse_step - 1e-9:  # m, a rounding
            raise ValueError(
                f"a scan from {self.low:g} to {self.high:g} m holds no two steps "
                f"of {self.coarse_step:g} m"
            )
        if self.fine_step < 2 * SETTING_STEP:
            raise ValueError(
                f"fine_step is {self.fine_step:g} m; places are set in steps of {SETTING_STEP:g} m"
            )
        if self.fine_step > self.coarse_step:
            raise ValueError("fine_step is above coarse_step")
        if self.fit_half_width < self.fine_step:
            raise ValueError("fit_half_width is below fine_step: no curve to fit")


@dataclass(frozen=True, slots=True, kw_only=True)
class Game(Spec):
    """Game conditions: pitch and swing for the conversion of e_A to v_f, Eqs. (3), (13), (14).

    A swing is a rotation (`angular_speed` about `axis_from_knob`) or one `bat_speed` wherever
    the ball is struck, times (reference / own)^exponent of what it scales with.
    """

    pitch_speed: Speed
    scales_with: Literal["inertia", "mass"]  # inertia about the axis of the swing
    exponent: Annotated[float, Ge(0), Dimension("number")]
    # others for which the certificate gives the result too
    exponents: Annotated[tuple[float, ...], Dimension("number")] = ()
    reference_inertia: Annotated[float | None, Dimension("inertia")] = None
    reference_mass: Annotated[float | None, Dimension("mass")] = None
    axis_from_knob: Annotated[float | None, Dimension("length")] = None
    angular_speed: Annotated[float | None, Dimension("angular speed")] = None
    bat_speed: Annotated[float | None, Dimension("speed")] = None

    def __post_init__(self) -> None:
        _require_positive(self, "angular_speed", "bat_speed", "reference_inertia", "reference_mass")
        if (self.angular_speed is None) == (self.bat_speed is None):
            raise ValueError("a swing has either an angular_speed or a bat_speed")
        if self.angular_speed is not None and self.axis_from_knob is None:
            raise ValueError("axis_from_knob is missing: what does the bat turn about?")
        if getattr(self, f"reference_{self.scales_with}") is None:
            raise ValueError(f"reference_{self.scales_with} is missing")


@dataclass(frozen=True, slots=True, kw_only=True)
class BallCorrection(Spec):
    """Correction for balls that differ from the standard ball.

    `none`; `ratio`: e in proportion to e0, exact for a rigid shell; `trampoline`: the ratio of
    the stiffnesses of shell and ball follows from e and e0, then e for the standard ball;
    `control-bat`: in proportion to the result of a bat of known e with the same lot.
    """

    method: Literal["none", "ratio", "trampoline", "control-bat"]
    standard: Number  # e0 of the standard ball, or e of the control bat


@dataclass(frozen=True, slots=True, kw_only=True)
class Eligibility(Spec):
    """Requirements on a bat before the first hit; a missing one is not applied."""

    length_less_weight: Annotated[float | None, Dimension("number")] = None  # inches less ounces
    barrel_diameter: Annotated[float | None, Dimension("length")] = None  # a ring must pass
    inertia_lengths: Annotated[tuple[float, ...], Dimension("length")] = ()
    inertia_floors: Annotated[tuple[float, ...], Dimension("inertia")] = ()  # about the pivot
    exempt: Title | None = None  # whom no test is asked of; the records do not tell such a bat

    def __post_init__(self) -> None:
        if len(self.inertia_lengths) != len(self.inertia_floors):
            raise ValueError(
                f"{len(self.inertia_floors)} inertia_floors for {len(self.inertia_lengths)} lengths"
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Procedure(Spec):
    """A test procedure, as far as rig and reduction need it."""

    name: Name
    title: Title
    edition: Title
    rig: str
    ball: str
    reads: Literal["recoil", "rebound"]  # what e_A is taken from
    recoil: Literal["pivoted", "free"]  # whose r Eq. (6) gets
    metric: Metric
    place: Literal["centre-of-percussion", "scan"]
    pivot_from_knob: Length
    ball_speed: Speed
    valid_hits: Count  # at each place
    attempts: Count
    balls: Count
    wall_hits: Count  # of each ball at each speed
    wall_speeds: Annotated[tuple[float, ...], Len(1, 20), SPEED]
    windows: Windows
    sport: Sport | None = None  # None: of any bat and ball
    bat_speed: Annotated[float | None, SPEED] = None  # 6 in from the tip; at rest
    limit: Annotated[float | None, Dimension("number")] = None
    speed_limit: Annotated[float | None, Dimension("speed")] = None  # of a batted ball
    # standard uncertainty of the metric, beyond which a result decides nothing
    largest_u: Annotated[float | None, Dimension("number")] = None
    largest_speed_u: Annotated[float | None, Dimension("speed")] = None  # of a batted ball
    # of e_A along the barrel at the place of a test at one place, over the bats it is made for
    place_slope: Annotated[float, Dimension("slope of length")] = 0.0
    place_slope_u: Annotated[float, Ge(0), Dimension("slope of length")] = 0.0
    scan: Scan | None = None
    game: Game | None = None
    correction: BallCorrection | None = None
    eligibility: Eligibility | None = None

    def __post_init__(self) -> None:
        _require_positive(self, "limit", "speed_limit", "largest_u", "largest_speed_u")
        if self.attempts < self.valid_hits:
            raise ValueError(f"{self.attempts} attempts cannot give {self.valid_hits} valid hits")
        if (self.place == "scan") != (self.scan is not None):
            raise ValueError("place = 'scan' and a table [scan] belong together")
        if self.scan is not None and (self.place_slope or self.place_slope_u):
            raise ValueError("a place_slope is for a test at one place, and a scan has many")
        if self.scan is not None and self.scan.coarse_hits > self.valid_hits:
            raise ValueError(
                f"{self.scan.coarse_hits} coarse_hits of a scan are more than the "
                f"{self.valid_hits} valid_hits of a place"
            )
        if self.reads == "recoil" and self.bat_speed is not None:
            raise ValueError("reads = 'recoil' is for a bat at rest, which has no bat_speed")
        self._require_keys_of_the_metric()
        self._require_what_is_sought()
        if self.scan is not None and self.scan.width_drop and self.metric == "batted_speed":
            raise ValueError("scan.width_drop is a number, and a batted_speed is none")

    def _require_keys_of_the_metric(self) -> None:
        numbers, speeds = ("limit", "largest_u"), ("speed_limit", "largest_speed_u")
        own, others = (speeds, numbers) if self.metric == "batted_speed" else (numbers, speeds)
        for right, wrong in zip(own, others, strict=True):
            if getattr(self, wrong) is not None:
                raise ValueError(f"{wrong} is not for the metric {self.metric}: write {right}")
        if getattr(self, own[1]) is None:
            raise ValueError(f"{own[1]} is missing: beyond which u does a result decide nothing?")

    def _require_what_is_sought(self) -> None:
        scan = self.scan
        if scan is None or scan.seeks == "metric":
            return
        if self.metric != "besr" or self.game is not None or self.correction is not None:
            raise ValueError("scan.seeks = 'batted_speed' is for the metric besr as tested")
        if scan.final_hits or scan.width_drop:
            raise ValueError("scan.seeks = 'batted_speed' takes the top of the fitted curve")

    @property
    def metric_limit(self) -> float | None:
        """The limit of the metric, SI; None where the rules set none."""
        return self.limit if self.speed_limit is None else self.speed_limit

    @property
    def largest_metric_u(self) -> float:
        """The largest standard uncertainty of a metric that decides, SI."""
        return self.largest_u or self.largest_speed_u or 0.0

    @property
    def controlled(self) -> bool:
        """Whether a control bat corrects for the balls."""
        return self.correction is not None and self.correction.method == "control-bat"

    @property
    def needs(self) -> frozenset[str]:
        """The channels a rig must write for this procedure, beside one that times the balls."""
        own = {"encoder"} if self.reads == "recoil" else set()
        moving = {"swing"} if self.bat_speed is not None else set()
        return frozenset({"log"} | own | moving)

    def turn_rate(self, length: ArrayLike) -> NDArray[np.float64]:
        """Return the nominal angular speed [rad/s] of a bat of a length [m]; 0 at rest."""
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
