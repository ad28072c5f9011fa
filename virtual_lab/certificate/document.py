"""The certificate as a typed document: the content of ``certificate.json`` and of all prints.

Text, page, card and figures are made only from this document, so a certificate can be printed,
compared and checked from its file. Numbers are unrounded and in SI unless the name has another
unit; unknown values are null.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from math import inf, isclose
from pathlib import Path
from typing import Annotated, Any, Literal

from annotated_types import Ge, Le

from virtual_lab.catalog.specs import Exact, Real, Spec, Whole, YesNo
from virtual_lab.catalog.validation import validate
from virtual_lab.errors import DISTRIBUTION, InputError, nearest
from virtual_lab.files import read_json
from virtual_lab.output.metrics import METRICS
from virtual_lab.records.origin import Simulated
from virtual_lab.records.particulars import NOTHING_STATED, Particulars
from virtual_lab.uncertainty.decision import conformity

SCHEMA = 4
READABLE = (3, SCHEMA)  # schemas that `verify` reads
SIMULATED = "SIMULATED: no real bat was tested and no accredited laboratory issued this."
SUPPLIED = "Computed by this program from records supplied by {}; not verified."
OPTIONAL = (  # not stated where the metric is the same quantity
    "bat_performance_factor",
    "collision_efficiency",
    "restitution",
    "recoil_factor",
    "ball_restitution",
)
Numbers = tuple[Real, ...]
Uncertainty = Annotated[float, Exact(), Ge(0)]


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated(Spec):
    """A value with its standard uncertainty; null if the test gave no result."""

    value: Real | None
    u: Uncertainty | None

    def __post_init__(self) -> None:
        if (self.value is None) != (self.u is None):
            raise ValueError("needs value and u, or null for both")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcedureStated(Spec):
    """The procedure, as far as a certificate describes it."""

    name: str
    title: str
    edition: str
    hits_needed: Whole
    at_percussion: YesNo  # whether the bat is hit at its centre of percussion
    swing_exponent: Real | None  # of the swing law that the metric is judged by


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

    ball: Whole
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
    value: Real | None
    u: Uncertainty | None
    interval_95: tuple[Real, Real] | None
    degrees_of_freedom: Real | None  # null: infinite
    u_type_a: Uncertainty | None
    u_type_b: Uncertainty | None
    unit: str
    limit: Real | None
    place_in: Real | None


@dataclass(frozen=True, slots=True, kw_only=True)
class RiskStated(Spec):
    """Specific risk of the verdict: the probability that it is wrong, by this result alone."""

    of: Literal["false acceptance", "false rejection"]
    probability: Annotated[float, Exact(), Ge(0), Le(1)]
    prior: Literal["none"] = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherRecoil(Spec):
    """Results from the same e_A with the recoil factor of the other support."""

    which: str
    recoil_factor: Real
    restitution: Real
    bat_performance_factor: Real


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoilStated(Spec):
    """The support (free or pivoted) whose recoil factor is used."""

    which: str
    other: OtherRecoil | None


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlRatio(Spec):
    """Measured e of a control bat with these balls over its known e."""

    value: Real
    u: Uncertainty
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionStated(Spec):
    """Correction for balls that differ from the standard ball."""

    method: str
    standard: Real
    control: ControlRatio | None


@dataclass(frozen=True, slots=True, kw_only=True)
class WidthStated(Spec):
    """Length of barrel on which the curve stays near its maximum [m]."""

    value: Real
    u: Uncertainty | None
    drop: Real
    at_least: YesNo
    from_in: Real
    to_in: Real


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingRow(Spec):
    """The metric for another exponent of the swing law."""

    exponent: Real
    value: Real
    u: Uncertainty
    interval_95: tuple[Real, Real]
    place_in: Real


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceRow(Spec):
    """One place of a scan: hits, their mean metric and its scatter."""

    place_in: Real
    hits: Whole
    mean: Real
    s: Uncertainty | None


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveAlong(Spec):
    """A quantity along the barrel: means of the hits at each of `places`, and a fitted curve."""

    name: str
    unit: str
    mean: Numbers
    u: tuple[Uncertainty | None, ...]  # of each mean, by scatter; null: of one hit
    curve: Numbers  # at `curve_in`


@dataclass(frozen=True, slots=True, kw_only=True)
class AlongBarrel(Spec):
    """Quantities along the barrel, each with one polynomial through every valid hit."""

    degree: Whole
    curve_in: Numbers  # places of the curves, from the tip
    quantities: tuple[CurveAlong, ...]
    read_in: Numbers  # of the metric's curve that the result is the top of; empty without one
    read: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleFinding(Spec):
    """One rule of eligibility, and whether the bat meets it."""

    sentence: str
    met: YesNo


@dataclass(frozen=True, slots=True, kw_only=True)
class FlagRaised(Spec):
    """A contradiction in the records."""

    name: str
    sentence: str
    invalidates: YesNo


@dataclass(frozen=True, slots=True, kw_only=True)
class RejectedHit(Spec):
    """A shot that does not count."""

    shot: Whole
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotRow(Spec):
    """One shot; null if nothing was seen or the rig has no such instrument."""

    shot: Whole
    ball: Whole
    place_in: Real
    speed_mph: Real | None
    bat_speed_mph: Real | None
    recoil_rad_per_s: Real | None
    recoil_efficiency: Real | None
    rebound_efficiency: Real | None
    metric: Real | None
    used: YesNo  # in the result
    reason: str  # why it does not count; empty where it does


@dataclass(frozen=True, slots=True, kw_only=True)
class ReboundCheck(Spec):
    """e_A from the rebound of the ball, compared with e_A from the recoil of the bat."""

    shots: Whole
    collision_efficiency: Real | None
    difference: Real | None
    u: Uncertainty | None  # of the difference's mean, by scatter


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedResult(Spec):
    """One quantity from the gates, from video, and combined."""

    gates: Stated
    video: Stated
    joined: Stated
    difference: Stated
    share_of_video: Real
    agree: YesNo

    def __post_init__(self) -> None:
        if None in (each.u for each in (self.gates, self.video, self.joined, self.difference)):
            raise ValueError("needs numbers of gates, video, joined and difference")


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraWord(Spec):
    """Results of the camera for the same hits."""

    hits: Whole
    missed: Whole
    collision_efficiency: ComparedResult | None
    restitution: ComparedResult | None
    bat_performance_factor: ComparedResult | None


@dataclass(frozen=True, slots=True, kw_only=True)
class RingStated(Spec):
    """The bending vibration of the bat in the encoder record."""

    frequencies_hz: Numbers
    decays_per_s: Numbers
    fitted_ms: Real | None = None  # length of the record that was used; null: not recorded


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace(Spec):
    """A record over the time after contact, with the fitted curve."""

    time_ms: Numbers
    angle_deg: Numbers
    fit_deg: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderTrace(Spec):
    """The encoder's record of one shot, for the figure."""

    shot: Whole
    settled_ms: Real  # from where on the ring is fitted
    turn: Trace
    ring: Trace


@dataclass(frozen=True, slots=True, kw_only=True)
class RingRecorded(Spec):
    """The encoder's record of one shot less its turn, after contact."""

    shot: Whole
    from_ms: Real
    step_ms: Real
    angle_deg: Numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class ChoiceStated(Spec):
    """Correction of a scan's result for the choice of the place."""

    correction: Real
    u: Uncertainty


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetLine(Spec):
    """One component of the metric's uncertainty."""

    component: str
    value: Real
    u: Uncertainty
    type: Literal["A", "B"]
    degrees_of_freedom: Real | None  # null: infinite
    sensitivity: Real
    contribution: Real
    share_percent: Real


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
class HallCondition(Spec):
    """A condition in the hall at the start and the end of the test; humidity is 1 of saturated."""

    name: str  # temperature, humidity, pressure
    unit: str
    at_start: Real
    at_end: Real
    u: Uncertainty


@dataclass(frozen=True, slots=True, kw_only=True)
class CommitStated(Spec):
    """The commit of this project's clone that made the certificate."""

    id: str
    changes: str  # digest of the program's files that differ from git's index; "": none


@dataclass(frozen=True, kw_only=True)
class CertificateDocument(Spec):
    """The complete certificate."""

    schema: Whole
    origin: Literal["simulated", "supplied"]
    statement: str  # what the result is worth, on every page
    procedure: ProcedureStated
    bat: BatAsMeasured
    ball: BallsUsed
    rigs: dict[str, str]
    air_density_kg_per_m3: Stated | None  # of the hall, on the day; null: not measured
    conditions: tuple[HallCondition, ...] = ()  # at start and end; (): not read
    laboratory: str  # that supplied the records; empty of a simulated test
    customer: str
    date: str
    particulars: Particulars = NOTHING_STATED  # what is stated beside the results
    metric: MetricStated
    verdict: Literal["PASS", "FAIL", "INVALID", "MEASURED"]
    marginal: YesNo
    risk: RiskStated | None  # null: no uncertain result, or more than its limit decides
    decision_rule: str
    bat_performance_factor: Stated | None = None
    collision_efficiency: Stated | None = None
    restitution: Stated | None = None
    recoil_factor: Stated | None = None
    ball_restitution: Stated | None = None
    recoil: RecoilStated
    ball_correction: CorrectionStated | None
    nominal_speed_mph: Real
    nominal_bat_speed_mph: Real
    v_rel_mph: Real | None
    impact_position_in: Real | None
    width_m: WidthStated | None
    swing_range: tuple[SwingRow, ...]
    places: tuple[PlaceRow, ...]  # of a scan
    along: AlongBarrel | None  # null: no scan, or too few places for a curve
    findings: tuple[RuleFinding, ...]
    flags: tuple[FlagRaised, ...]
    not_checked: tuple[str, ...] = ()  # checks for which a recorder that sums up keeps too little
    incomplete: str
    reasons: tuple[str, ...]  # why the verdict is INVALID or FAIL
    valid_hits: Whole
    rejected_hits: tuple[RejectedHit, ...]
    shots: tuple[ShotRow, ...]
    rebound_check: ReboundCheck | None
    second_witness: CameraWord | None
    ring: RingStated | None
    encoder: EncoderTrace | None
    contact_sheet: tuple[RingRecorded, ...]  # of every shot that the encoder saw
    choice: ChoiceStated | None
    conditional_on: str
    budget: tuple[BudgetLine, ...]  # largest first
    evaluation: str = ""  # by which method, and which tests tell the scatter of the hits
    unverified: tuple[UnverifiedValue, ...]
    simulation: SimulationStated | None  # null: of supplied records
    versions: dict[str, str]
    session_digest: str | None = None  # SHA-256 of session.json with LF, which has those of all
    # other records; null: no records were written
    # null: an installed program; the certificate's number does not depend on it
    commit: CommitStated | None = None

    @property
    def states_result(self) -> bool:
        """Whether a form shows the metric as a result: that of an invalid test is none."""
        return self.metric.value is not None and self.verdict != "INVALID"

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

    @cached_property
    def text(self) -> str:
        """The text of ``certificate.json``, from which every form is made."""
        return text_of(self.as_json())

    @cached_property
    def number(self) -> str:
        """The number of the certificate, which follows from its content."""
        return number_of(self.as_json())


def text_of(stated: Mapping[str, Any]) -> str:
    """Return the text of a ``certificate.json`` with these values."""
    return json.dumps(stated, indent=2, allow_nan=False) + "\n"


def number_of(stated: Mapping[str, Any]) -> str:
    """Return the number of a certificate with these values of JSON, of any schema."""
    counted = {**stated, "commit": None} if "commit" in stated else stated
    return hashlib.sha256(text_of(counted).encode()).hexdigest()[:12]


def risk_of(metric: MetricStated, verdict: str, *, eligible: bool) -> RiskStated | None:
    """Return the risk of a verdict that the limit alone decides, None of any other.

    `eligible` says whether the bat meets every rule but the limit.
    """
    value, u, limit = metric.value, metric.u, metric.limit
    if value is None or not u or limit is None or not eligible or verdict == "INVALID":
        return None
    dof = inf if metric.degrees_of_freedom is None else metric.degrees_of_freedom
    conforming = conformity(value, u, upper=limit, dof=dof)
    if verdict == "PASS":
        return RiskStated(of="false acceptance", probability=1 - conforming)
    return RiskStated(of="false rejection", probability=conforming)


def statement_of(laboratory: str | None) -> str:
    """Return the sentence on a result's origin: simulated (None), or a laboratory's records."""
    return SIMULATED if laboratory is None else SUPPLIED.format(laboratory)


def document_of(parsed: dict[str, Any], where: str) -> CertificateDocument:
    """Return the document of parsed JSON; `InputError` names a key that does not fit the rest."""
    if parsed.get("schema") != SCHEMA:
        allowed = f"allowed: {SCHEMA}; make the certificate again with 'virtual-lab reduce RECORDS'"
        raise InputError(where, "schema", parsed.get("schema"), allowed)
    document = validate(parsed, where, CertificateDocument)
    for key, value, allowed in _contradictions(document):
        raise InputError(where, key, value, allowed)
    return document


def _contradictions(document: CertificateDocument) -> Iterator[tuple[str, Any, str]]:
    """Yield contradictions within a certificate, each as key, value and allowed values."""
    metric = document.metric
    if metric.name not in METRICS:
        allowed = f"{nearest(metric.name, METRICS)}allowed: {', '.join(METRICS)}"
        yield "metric.name", metric.name, allowed
    elif metric.unit != METRICS[metric.name].si_unit:
        yield "metric.unit", metric.unit, f"allowed: {METRICS[metric.name].si_unit!r}"
    yield from _foreign_words(document)
    result = (metric.value, metric.u, metric.u_type_a, metric.u_type_b, metric.interval_95)
    if len({each is None for each in result}) > 1:
        yield "metric", None, "needs value, u, u_type_a, u_type_b and interval_95, or null for all"
    for key, stated in (
        ("metric.place_in", metric.place_in),
        ("v_rel_mph", document.v_rel_mph),
        ("impact_position_in", document.impact_position_in),
    ):
        if metric.value is not None and stated is None:
            yield key, None, "needs a number beside a metric with a value"
    if metric.value is None or metric.interval_95 is None:
        met, inside = True, False
    else:
        low, high = metric.interval_95
        if not low <= metric.value <= high:
            yield "metric.interval_95", f"{low:g} to {high:g}", f"must hold {metric.value:g}"
        met = metric.limit is None or metric.value <= metric.limit
        inside = metric.limit is not None and low <= metric.limit <= high
    eligible = all(finding.met for finding in document.findings)
    sound = document.verdict != "INVALID" and metric.value is not None
    if document.verdict != "INVALID" and document.verdict != (right := _verdict(document, met)):
        yield "verdict", document.verdict, f"by value, limit, findings and flags: {right}"
    if bool(document.reasons) != (document.verdict in ("FAIL", "INVALID")):
        allowed = "reasons belong to FAIL and INVALID, and to no other verdict"
        yield "reasons", "; ".join(document.reasons) or None, allowed
    risk = risk_of(metric, document.verdict, eligible=eligible)
    if not _same_risk(document.risk, risk):
        yield "risk", document.risk and document.risk.probability, f"by the metric: {risk}"
    if document.marginal != (sound and eligible and inside):
        allowed = "true where only the limit decides and lies within interval_95, else false"
        yield "marginal", document.marginal, allowed


def _same_risk(stated: RiskStated | None, found: RiskStated | None) -> bool:
    if stated is None or found is None:
        return stated is found
    close = isclose(stated.probability, found.probability, rel_tol=1e-6, abs_tol=1e-12)
    return close and stated.of == found.of


def _verdict(document: CertificateDocument, met: bool) -> str:
    """Return the verdict on a bat whose metric meets its limit or not, INVALID aside."""
    if document.metric.value is None or any(flag.invalidates for flag in document.flags):
        return "INVALID"
    if not (met and all(finding.met for finding in document.findings)):
        return "FAIL"
    return "MEASURED" if document.metric.limit is None else "PASS"


def _foreign_words(document: CertificateDocument) -> Iterator[tuple[str, Any, str]]:
    """Yield words that contradict the origin of a certificate."""
    simulated = document.origin == "simulated"
    if simulated != (document.simulation is not None):
        yield "simulation", None, f"is for the origin 'simulated', here it is {document.origin!r}"
    if simulated == bool(document.laboratory):
        yield "laboratory", document.laboratory, f"does not fit the origin {document.origin!r}"
    statement = statement_of(None if simulated else document.laboratory)
    if document.statement != statement:
        yield "statement", document.statement, f"allowed: {statement}"


def read_document(path: Path) -> CertificateDocument:
    """Return the certificate in a file; `InputError` if it has none."""
    return document_of(read_json(path), str(path))


def json_schema() -> dict[str, Any]:
    """Return the JSON Schema of ``certificate.json``, of the draft 2020-12."""
    from pydantic import TypeAdapter

    named = {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": f"urn:{DISTRIBUTION}:certificate:{SCHEMA}",
    }
    return named | TypeAdapter(CertificateDocument).json_schema()


def _lists(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _lists(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_lists(item) for item in value]
    return value
