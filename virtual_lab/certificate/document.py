"""The certificate as a typed document: the content of ``certificate.json`` and of all prints.

Text, page, card and figures are made only from this document, so a certificate can be printed,
compared and checked from its file. Numbers are unrounded and in SI unless the name has another
unit; unknown values are null.
"""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from virtual_lab.catalog.specs import Spec
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import InputError
from virtual_lab.files import read_json
from virtual_lab.records.origin import Simulated

SCHEMA = 3
SIMULATED = "SIMULATED: no real bat was tested and no accredited laboratory issued this."
SUPPLIED = "Computed by this program from records supplied by {}; not verified."
OPTIONAL = (  # not stated where the metric is the same quantity
    "bat_performance_factor",
    "collision_efficiency",
    "restitution",
    "recoil_factor",
    "ball_restitution",
)
Numbers = tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated(Spec):
    """A value with its standard uncertainty; null if the test gave no result."""

    value: float | None
    u: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcedureStated(Spec):
    """The procedure, as far as a certificate describes it."""

    name: str
    title: str
    edition: str
    hits_needed: int
    at_percussion: bool  # whether the bat is hit at its centre of percussion
    swing_exponent: float | None  # of the swing law that the metric is judged by


@dataclass(frozen=True, slots=True, kw_only=True)
class BatAsMeasured(Spec):
    """The bat's inertial properties; places from the barrel tip."""

    name: str
    mass_kg: Stated
    length_m: Stated
    z_cm_m: Stated
    inertia_cm_kg_m2: Stated


@dataclass(frozen=True, slots=True, kw_only=True)
class BallSetAside(Spec):
    """A ball outside the procedure's windows for balls."""

    ball: int
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BallsUsed(Spec):
    """The balls of the test."""

    name: str
    ball_restitution_is: str
    set_aside: tuple[BallSetAside, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricStated(Spec):
    """The result that decides the verdict, in SI."""

    name: str
    value: float | None
    u: float | None
    interval_95: tuple[float, float] | None
    degrees_of_freedom: float | None  # null: infinite
    u_type_a: float | None
    u_type_b: float | None
    unit: str
    limit: float | None
    place_in: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherRecoil(Spec):
    """Results from the same e_A with the recoil factor of the other support."""

    which: str
    recoil_factor: float
    restitution: float
    bat_performance_factor: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoilStated(Spec):
    """The support (free or pivoted) whose recoil factor is used."""

    which: str
    other: OtherRecoil | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlRatio(Spec):
    """Measured e of a control bat with these balls over its known e."""

    value: float
    u: float
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionStated(Spec):
    """Correction for balls that differ from the standard ball."""

    method: str
    standard: float
    control: ControlRatio | None


@dataclass(frozen=True, slots=True, kw_only=True)
class WidthStated(Spec):
    """Length of barrel on which the curve stays near its maximum [m]."""

    value: float
    u: float | None
    drop: float
    at_least: bool
    from_in: float
    to_in: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingRow(Spec):
    """The metric for another exponent of the swing law."""

    exponent: float
    value: float
    u: float
    interval_95: tuple[float, float]
    place_in: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceRow(Spec):
    """One place of a scan: hits, their mean metric and its scatter."""

    place_in: float
    hits: int
    mean: float
    s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleFinding(Spec):
    """One rule of eligibility, and whether the bat meets it."""

    sentence: str
    met: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class FlagRaised(Spec):
    """A contradiction in the records."""

    name: str
    sentence: str
    invalidates: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class RejectedHit(Spec):
    """A shot that does not count."""

    shot: int
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotRow(Spec):
    """One shot; null if nothing was seen or the rig has no such instrument."""

    shot: int
    ball: int
    place_in: float
    speed_mph: float | None
    bat_speed_mph: float | None
    recoil_rad_per_s: float | None
    recoil_efficiency: float | None
    rebound_efficiency: float | None
    metric: float | None
    used: bool  # in the result
    reason: str  # why it does not count; empty where it does


@dataclass(frozen=True, slots=True, kw_only=True)
class ReboundCheck(Spec):
    """e_A from the rebound of the ball, compared with e_A from the recoil of the bat."""

    shots: int
    collision_efficiency: float | None
    difference: float | None
    u: float | None  # of the difference's mean, by scatter


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedResult(Spec):
    """One quantity from the gates, from video, and combined."""

    gates: Stated
    video: Stated
    joined: Stated
    difference: Stated
    share_of_video: float
    agree: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraWord(Spec):
    """Results of the camera for the same hits."""

    hits: int
    missed: int
    collision_efficiency: ComparedResult | None
    restitution: ComparedResult | None
    bat_performance_factor: ComparedResult | None


@dataclass(frozen=True, slots=True, kw_only=True)
class RingStated(Spec):
    """The bending vibration of the bat in the encoder record."""

    frequencies_hz: Numbers
    decays_per_s: Numbers
    fitted_ms: float | None = None  # length of the record that was used; null: not recorded


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace(Spec):
    """A record over the time after contact, with the fitted curve."""

    time_ms: Numbers
    angle_deg: Numbers
    fit_deg: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderTrace(Spec):
    """The encoder's record of one shot, for the figure."""

    shot: int
    settled_ms: float  # from where on the ring is fitted
    turn: Trace
    ring: Trace


@dataclass(frozen=True, slots=True, kw_only=True)
class ChoiceStated(Spec):
    """Correction of a scan's result for the choice of the place."""

    correction: float
    u: float


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetLine(Spec):
    """One component of the metric's uncertainty."""

    component: str
    value: float
    u: float
    type: Literal["A", "B"]
    degrees_of_freedom: float | None  # null: infinite
    sensitivity: float
    contribution: float
    share_percent: float


@dataclass(frozen=True, slots=True, kw_only=True)
class UnverifiedValue(Spec):
    """A value of the procedure that was not verified in its source."""

    key: str
    value: str
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationStated(Simulated):
    """How the test was simulated, and the digest of its truth; null: reduced from records alone."""

    truth_digest: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CertificateDocument(Spec):
    """The complete certificate."""

    schema: int
    origin: Literal["simulated", "supplied"]
    statement: str  # what the result is worth, on every page
    procedure: ProcedureStated
    bat: BatAsMeasured
    ball: BallsUsed
    rigs: dict[str, str]
    laboratory: str  # that supplied the records; empty of a simulated test
    customer: str
    date: str
    metric: MetricStated
    verdict: Literal["PASS", "FAIL", "INVALID", "MEASURED"]
    marginal: bool
    decision_rule: str
    bat_performance_factor: Stated | None = None
    collision_efficiency: Stated | None = None
    restitution: Stated | None = None
    recoil_factor: Stated | None = None
    ball_restitution: Stated | None = None
    recoil: RecoilStated
    ball_correction: CorrectionStated | None
    nominal_speed_mph: float
    nominal_bat_speed_mph: float
    v_rel_mph: float | None
    impact_position_in: float | None
    width_m: WidthStated | None
    swing_range: tuple[SwingRow, ...]
    places: tuple[PlaceRow, ...]  # of a scan
    findings: tuple[RuleFinding, ...]
    flags: tuple[FlagRaised, ...]
    not_checked: tuple[str, ...] = ()  # checks for which a recorder that sums up keeps too little
    incomplete: str
    reasons: tuple[str, ...]  # why the verdict is INVALID or FAIL
    valid_hits: int
    rejected_hits: tuple[RejectedHit, ...]
    shots: tuple[ShotRow, ...]
    rebound_check: ReboundCheck | None
    second_witness: CameraWord | None
    ring: RingStated | None
    encoder: EncoderTrace | None
    choice: ChoiceStated | None
    conditional_on: str
    budget: tuple[BudgetLine, ...]  # largest first
    unverified: tuple[UnverifiedValue, ...]
    simulation: SimulationStated | None  # null: of supplied records
    versions: dict[str, str]

    @property
    def quantities(self) -> dict[str, Stated]:
        """The quantities other than the metric, by name."""
        found = {name: getattr(self, name) for name in OPTIONAL}
        return {name: stated for name, stated in found.items() if stated is not None}

    def as_json(self) -> dict[str, Any]:
        """Return the document as JSON values."""
        found = asdict(self)
        for name in OPTIONAL:
            if found[name] is None:
                del found[name]
        document: dict[str, Any] = _lists(found)
        return document

    def text(self) -> str:
        """Return the text of ``certificate.json``."""
        return json.dumps(self.as_json(), indent=2, allow_nan=False) + "\n"


def statement_of(laboratory: str | None) -> str:
    """Return what a result is worth: simulated, or from the records of a laboratory."""
    return SIMULATED if laboratory is None else SUPPLIED.format(laboratory)


def document_of(parsed: dict[str, Any], where: str) -> CertificateDocument:
    """Return the document of parsed JSON; `InputError` names a key that does not fit."""
    if parsed.get("schema") != SCHEMA:
        allowed = f"allowed: {SCHEMA}; make the certificate again with 'virtual-lab reduce RECORDS'"
        raise InputError(where, "schema", parsed.get("schema"), allowed)
    return validate(parsed, where, CertificateDocument)


def read_document(path: Path) -> CertificateDocument:
    """Return the certificate in a file; `InputError` if it has none."""
    return document_of(read_json(path), str(path))


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of ``certificate.json``."""
    from pydantic import TypeAdapter

    return TypeAdapter(CertificateDocument).json_schema()


def _lists(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _lists(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_lists(item) for item in value]
    return value
