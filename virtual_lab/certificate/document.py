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
from virtual_lab.errors import InputError, nearest
from virtual_lab.files import read_json
from virtual_lab.output.metrics import METRICS
from virtual_lab.records.origin import Simulated
from virtual_lab.records.particulars import NOTHING_STATED, Particulars
from virtual_lab.uncertainty.decision import conformity

SCHEMA = 7
SIMULATED = "SIMULATED: no real bat was tested and no accredited laboratory issued this."
SUPPLIED = "Computed by this program from records supplied by {}; not verified."
OPTIONAL = (  # quantities that are left out if the metric is the same quantity
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
    """Value; null: the test gave no result."""
    u: Uncertainty | None
    """Standard uncertainty of the value, in its unit; null with it."""

    def __post_init__(self) -> None:
        if (self.value is None) != (self.u is None):
            raise ValueError("needs value and u, or null for both")


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcedureStated(Spec):
    """The procedure, as far as a certificate describes it."""

    name: str
    """Name of the procedure's sheet."""
    title: str
    """Title of the procedure in print."""
    edition: str
    """Edition of the rules that the sheet follows."""
    hits_needed: Whole
    """Number of valid hits that the procedure requires."""
    at_percussion: YesNo
    """Whether the bat is hit at its center of percussion."""
    exempt: str
    """Bats of which the procedure requires no test; empty: none."""
    swing_exponent: Real | None
    """Exponent of the swing law by which the metric is judged; null: the metric needs none."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BatAsMeasured(Spec):
    """The bat's inertial properties; positions are measured from the barrel tip."""

    name: str
    """Name of the bat."""
    construction: str
    """Construction of the bat as the laboratory states it; empty: not stated."""
    mass_kg: Stated
    """Mass of the bat."""
    length_m: Stated
    """Length of the bat."""
    z_cm_m: Stated
    """Distance of the center of mass from the barrel tip."""
    inertia_cm_kg_m2: Stated
    """Moment of inertia about the center of mass."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BallSetAside(Spec):
    """A ball outside the procedure's windows for balls."""

    ball: Whole
    """Number of the ball."""
    reason: str
    """Window of the procedure that the ball misses, with its value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BallsUsed(Spec):
    """The balls of the test."""

    name: str
    """Name of the kind of ball."""
    ball_restitution_is: str
    """Sentence on the balls to which e0 refers."""
    set_aside: tuple[BallSetAside, ...]
    """Balls that the test does not use."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MetricStated(Spec):
    """The result that decides the verdict, in SI."""

    name: str
    """Name of the metric."""
    value: Real | None
    """Value of the metric, in `unit`; null: the test gave no result."""
    u: Uncertainty | None
    """Standard uncertainty of the value, in `unit`."""
    interval_95: tuple[Real, Real] | None
    """Ends of the 95 % coverage interval, in `unit`."""
    dof: Real | None
    """Effective degrees of freedom of u (Welch and Satterthwaite); null: infinite."""
    u_type_a: Uncertainty | None
    """Part of u from the scatter of readings (type A), in `unit`."""
    u_type_b: Uncertainty | None
    """Part of u from other information (type B), in `unit`."""
    unit: str
    """SI unit of value, u, interval and limit; empty: a pure number."""
    limit: Real | None
    """Largest value that passes, in `unit`; null: the procedure has no limit."""
    impact_position_in: Real | None
    """Impact position to which the value refers, from the barrel tip; null: no result."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RiskStated(Spec):
    """Specific risk of the verdict: the probability that it is wrong, by this result alone."""

    of: Literal["false acceptance", "false rejection"]
    """Kind of wrong verdict."""
    probability: Annotated[float, Exact(), Ge(0), Le(1)]
    """Probability that the verdict is wrong, given this result, 0 to 1."""
    prior: Literal["none"] = "none"
    """Knowledge of the bat before the test that the probability uses."""


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherRecoil(Spec):
    """Results from the same e_A with the recoil factor of the other support."""

    which: str
    """The other support: free or pivoted."""
    recoil_factor: Real
    """Recoil factor r of the other support."""
    restitution: Real
    """Restitution e from the same e_A with this r."""
    bat_performance_factor: Real
    """Bat performance factor from this e."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoilStated(Spec):
    """The support (free or pivoted) whose recoil factor is used."""

    which: str
    """Support whose recoil factor the results use: free or pivoted."""
    other: OtherRecoil | None
    """Results with the other support; null: not computed."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlRatio(Spec):
    """Ratio of the measured e of a control bat with these balls to its known e."""

    value: Real
    """Ratio of the measured e of the control bat to its known e."""
    u: Uncertainty
    """Standard uncertainty of the ratio."""
    source: str
    """Origin of the ratio."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrectionStated(Spec):
    """Correction for balls that differ from the standard ball."""

    method: str
    """Name of the correction."""
    standard: Real
    """Restitution e0 of the standard ball."""
    control: ControlRatio | None
    """Result of the control bat; null: no control bat was tested."""
    as_found: Stated | None = None
    """Metric with the balls of this test, not corrected, in SI; null: schema 4 did not state it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class WidthStated(Spec):
    """Length of barrel on which the curve stays near its maximum [m]."""

    value: Real
    """Length of barrel [m]."""
    u: Uncertainty | None
    """Standard uncertainty of the length [m]; null: an end lies beyond the tested positions."""
    drop: Real
    """Allowed drop below the maximum of the curve, in SI."""
    at_least: YesNo
    """Whether an end lies beyond the tested positions, so that the length is a lower bound."""
    from_in: Real
    """End of the length nearer to the tip, from the barrel tip."""
    to_in: Real
    """Other end of the length, from the barrel tip."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SwingRow(Spec):
    """The metric for another exponent of the swing law."""

    exponent: Real
    """Exponent of the swing law."""
    value: Real
    """Metric for this exponent, in the metric's unit."""
    u: Uncertainty
    """Standard uncertainty of the value."""
    interval_95: tuple[Real, Real]
    """Ends of the 95 % coverage interval."""
    impact_position_in: Real
    """Impact position of the largest value, from the barrel tip."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceRow(Spec):
    """One impact position of a scan: number of hits, mean and scatter of their metric."""

    impact_position_in: Real
    """Impact position, from the barrel tip."""
    hits: Whole
    """Number of valid hits there."""
    mean: Real
    """Mean metric of these hits, in the metric's unit."""
    s: Uncertainty | None
    """Standard deviation of these hits; null: one hit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CurveAlong(Spec):
    """A quantity along the barrel: means of the hits at each of `places`, and a fitted curve."""

    name: str
    """Name of the quantity."""
    unit: str
    """SI unit of the quantity; empty: a pure number."""
    mean: Numbers
    """Mean of the valid hits at each tested position."""
    u: tuple[Uncertainty | None, ...]
    """Standard uncertainty of each mean from the scatter of its hits; null: one hit."""
    curve: Numbers
    """Fitted curve at the positions `curve_in`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AlongBarrel(Spec):
    """Quantities along the barrel, each with one polynomial through every valid hit."""

    degree: Whole
    """Degree of the fitted polynomials."""
    curve_in: Numbers
    """Positions of the curves, from the barrel tip."""
    quantities: tuple[CurveAlong, ...]
    """The quantities, each with its means and its curve."""
    read_in: Numbers
    """Positions, from the barrel tip, of the curve whose maximum is the result; empty: no curve."""
    read: Numbers
    """Metric on this curve, in the metric's unit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RuleFinding(Spec):
    """One rule of eligibility, and whether the bat meets it."""

    sentence: str
    """Sentence on the rule and the bat."""
    met: YesNo
    """Whether the bat meets the rule."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FlagRaised(Spec):
    """A contradiction in the records."""

    name: str
    """Name of the contradiction."""
    sentence: str
    """Sentence on the contradiction, with its figures."""
    invalidates: YesNo
    """Whether it makes the test INVALID."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RejectedHit(Spec):
    """A shot that does not count."""

    shot: Whole
    """Number of the shot."""
    reason: str
    """Reason why the shot does not count."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ShotRow(Spec):
    """One shot. A value is null if it was not measured or the rig has no such instrument."""

    shot: Whole
    ball: Whole
    impact_position_in: Real
    speed_mph: Real | None
    bat_speed_mph: Real | None
    recoil_rad_per_s: Real | None
    recoil_efficiency: Real | None
    rebound_efficiency: Real | None
    value: Real | None
    used: YesNo
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ReboundCheck(Spec):
    """e_A from the rebound of the ball, compared with e_A from the recoil of the bat."""

    shots: Whole
    """Number of valid hits with a measured rebound."""
    collision_efficiency: Real | None
    """Mean e_A from the rebound; null: no rebound was measured."""
    difference: Real | None
    """Mean of e_A from the rebound minus e_A from the recoil."""
    u: Uncertainty | None
    """Standard uncertainty of this mean from the scatter of the hits; null: one hit."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparedResult(Spec):
    """One quantity from the gates, from video, and combined."""

    gates: Stated
    """Result from the gates."""
    video: Stated
    """Result from video."""
    joined: Stated
    """Weighted mean of both."""
    difference: Stated
    """Video minus gates."""
    share_of_video: Real
    """Weight of video in the mean, 0 to 1."""
    agree: YesNo
    """Whether the difference is within its expanded uncertainty."""

    def __post_init__(self) -> None:
        if None in (each.u for each in (self.gates, self.video, self.joined, self.difference)):
            raise ValueError("needs numbers of gates, video, joined and difference")


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraWord(Spec):
    """Results of the camera for the same hits."""

    hits: Whole
    """Number of hits in the result that gates and video both measured."""
    missed: Whole
    """Number of hits in the result that were not measured by both."""
    collision_efficiency: ComparedResult | None
    """Collision efficiency e_A of these hits; null: not compared."""
    restitution: ComparedResult | None
    """Restitution e of these hits; null: not compared."""
    bat_performance_factor: ComparedResult | None
    """Bat performance factor of these hits; null: not compared."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RingStated(Spec):
    """The bending vibration of the bat in the encoder record."""

    frequencies_hz: Numbers
    """Fitted frequencies of the vibration."""
    decays_per_s: Numbers
    """Fitted decay rates of the vibration."""
    fitted_ms: Real | None = None
    """Length of the record that the fit uses; null: not recorded."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace(Spec):
    """A record against the time after contact, with the fitted curve."""

    time_ms: Numbers
    """Time after contact."""
    angle_deg: Numbers
    """Measured angle at these times."""
    fit_deg: Numbers
    """Fitted angle at these times."""


@dataclass(frozen=True, slots=True, kw_only=True)
class EncoderTrace(Spec):
    """The encoder's record of one shot, for the figure."""

    shot: Whole
    """Number of the shot."""
    settled_ms: Real
    """Time after contact from which the vibration is fitted."""
    turn: Trace
    """Rotation of the bat."""
    ring: Trace
    """Vibration of the bat: measured angle minus fitted rotation."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RingRecorded(Spec):
    """The encoder's record of one shot after contact, minus the fitted rotation."""

    shot: Whole
    """Number of the shot."""
    from_ms: Real
    """Time of the first sample after contact."""
    step_ms: Real
    """Time between samples."""
    angle_deg: Numbers
    """Measured angle minus fitted rotation at each sample."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ChoiceStated(Spec):
    """Correction of a scan's result for choosing the best impact position."""

    correction: Real
    """Correction of the metric for choosing the best position of a scan, in SI."""
    u: Uncertainty
    """Standard uncertainty of the correction."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BudgetLine(Spec):
    """One component of the metric's uncertainty."""

    component: str
    """Name of the source of uncertainty."""
    value: Real
    """Value of the input, in SI."""
    u: Uncertainty
    """Standard uncertainty of the input, in SI."""
    evaluation: Literal["A", "B"]
    """Evaluation: A from readings, B from other information."""
    dof: Real | None
    """Degrees of freedom of u; null: infinite."""
    sensitivity: Real
    """Partial derivative of the metric by the input, in SI."""
    contribution: Real
    """Uncertainty of the metric from this input, in SI."""
    share_percent: Real
    """Share of the variance of the metric."""


@dataclass(frozen=True, slots=True, kw_only=True)
class UnverifiedValue(Spec):
    """A value of the procedure that was not verified in its source."""

    key: str
    """Key in the procedure's sheet."""
    value: str
    """Value with its unit."""
    source: str
    """Source as the sheet names it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulationStated(Simulated):
    """Simulation of the test, and the digest of its truth."""

    truth_digest: str | None
    """SHA-256 of the sealed truth; null: reduced from the records alone."""


@dataclass(frozen=True, slots=True, kw_only=True)
class HallCondition(Spec):
    """A condition in the hall at the start and the end of the test."""

    name: str
    """Name of the condition: temperature, humidity or pressure."""
    unit: str
    """SI unit of the condition."""
    at_start: Real
    """Value at the start of the test; a humidity of 1 is saturated air."""
    at_end: Real
    """Value at the end of the test."""
    u: Uncertainty
    """Standard uncertainty of each value."""


@dataclass(frozen=True, slots=True, kw_only=True)
class CommitStated(Spec):
    """The commit of this project's clone that made the certificate."""

    id: str
    """Identifier of the commit."""
    changes: str
    """Digest of the program's files that differ from this commit; empty: none."""


@dataclass(frozen=True, kw_only=True)
class CertificateDocument(Spec):
    """The complete certificate."""

    schema: Whole
    """Number of this schema."""
    origin: Literal["simulated", "supplied"]
    """Origin of the records: this simulation, or another laboratory."""
    statement: str
    """Sentence on the origin of the result, printed on every page."""
    procedure: ProcedureStated
    """Procedure of the test."""
    bat: BatAsMeasured
    """Inertial properties of the bat."""
    ball: BallsUsed
    """Balls of the test."""
    rigs: dict[str, str]
    """Rig of each stage of the test, by the name of the stage."""
    air_density_kg_per_m3: Stated | None
    """Density of the air in the hall on the day of the test; null: not measured."""
    conditions: tuple[HallCondition, ...] = ()
    """Conditions in the hall; empty: not read."""
    laboratory: str
    """Laboratory that supplied the records; empty: a simulated test."""
    customer: str
    """Customer that the laboratory names; empty: not stated."""
    date: str
    """Date of the test as the records state it."""
    particulars: Particulars = NOTHING_STATED
    """Particulars that the report states beside the results."""
    metric: MetricStated
    """Result that decides the verdict."""
    verdict: Literal["PASS", "FAIL", "INVALID", "MEASURED"]
    """Verdict; MEASURED: the procedure has no limit."""
    marginal: YesNo
    """True if the limit decides the verdict and is inside the 95 % interval."""
    risk: RiskStated | None
    """Risk of a wrong verdict; null: no uncertainty, or the limit alone does not decide."""
    decision_rule: str
    """Rule by which the verdict follows from the result."""
    bat_performance_factor: Stated | None = None
    """Bat performance factor; left out if it is the metric."""
    collision_efficiency: Stated | None = None
    """Collision efficiency e_A; left out if it is the metric."""
    restitution: Stated | None = None
    """Restitution e; left out if it is the metric."""
    recoil_factor: Stated | None = None
    """Recoil factor r."""
    ball_restitution: Stated | None = None
    """Restitution e0 of the lot at the speed of the test."""
    recoil: RecoilStated
    """Support of the bat whose recoil factor is used."""
    ball_correction: CorrectionStated | None
    """Correction for the balls; null: none is applied."""
    nominal_speed_mph: Real
    """Nominal speed of the ball."""
    nominal_bat_speed_mph: Real
    """Nominal speed of the bat; 0: the bat is at rest."""
    v_rel_mph: Real | None
    """Mean relative speed of the hits in the result; null: no hits."""
    impact_position_in: Real | None
    """Impact position of the result, from the barrel tip; null: no result."""
    width_m: WidthStated | None
    """Length of barrel near the maximum; null: no scan."""
    swing_range: tuple[SwingRow, ...]
    """Metric for other swing laws."""
    places: tuple[PlaceRow, ...]
    """Tested positions of a scan."""
    along: AlongBarrel | None
    """Curves along the barrel; null: no scan, or too few positions for a curve."""
    findings: tuple[RuleFinding, ...]
    """Rules of eligibility."""
    flags: tuple[FlagRaised, ...]
    """Contradictions in the records."""
    not_checked: tuple[str, ...] = ()
    """Checks that were not made, because the records lack the readings for them."""
    deviations: tuple[str, ...] = ()
    """Decisions on hits against the rules, by a person at the rehearsal bench."""
    incomplete: str
    """Reason why the test gave no result; empty: it gave one."""
    reasons: tuple[str, ...]
    """Reasons of the verdict; empty: PASS, or MEASURED without a limit."""
    valid_hits: Whole
    """Number of valid hits."""
    rejected_hits: tuple[RejectedHit, ...]
    """Shots that do not count."""
    shots: tuple[ShotRow, ...]
    """All shots in their order."""
    rebound_check: ReboundCheck | None
    """Comparison of e_A from rebound and recoil; null: no instrument measured the recoil."""
    second_witness: CameraWord | None
    """Results of the camera; null: no camera."""
    ring: RingStated | None
    """Vibration in the encoder record; null: no encoder."""
    encoder: EncoderTrace | None
    """Encoder record of one shot for the figure; null: no counts were recorded."""
    contact_sheet: tuple[RingRecorded, ...]
    """Encoder record of each shot with a measured speed."""
    choice: ChoiceStated | None
    """Correction for choosing the best position; null: not applied."""
    conditional_on: str
    """Assumptions behind the result and its uncertainty."""
    budget: tuple[BudgetLine, ...]
    """Sources of uncertainty of the metric, the largest first."""
    evaluation: str = ""
    """Method of the evaluation, and the tests that give the scatter of the hits."""
    unverified: tuple[UnverifiedValue, ...]
    """Values of the procedure that were not verified in their source."""
    simulation: SimulationStated | None
    """The simulation; null: supplied records."""
    versions: dict[str, str]
    """Versions of the program and its libraries, keyed by name."""
    session_digest: str | None = None
    """SHA-256 of session.json, which states the digests of all records; null: no such file."""
    commit: CommitStated | None = None
    """Commit of the clone that made the certificate; null: an installed program.

    The certificate's number does not depend on it.
    """

    @property
    def states_result(self) -> bool:
        """Whether the metric is shown as a result, which it is not if the test is invalid."""
        return self.metric.value is not None and self.verdict != "INVALID"

    @property
    def quantities(self) -> dict[str, Stated]:
        """The quantities other than the metric, keyed by name."""
        by_name = {name: getattr(self, name) for name in OPTIONAL}
        return {name: stated for name, stated in by_name.items() if stated is not None}

    def as_json(self) -> dict[str, Any]:
        """Return the document as JSON values."""
        document: dict[str, Any] = json.loads(self.text)
        return document

    @cached_property
    def text(self) -> str:
        """The text of ``certificate.json``, from which every form is made."""
        content = asdict(self)
        for name in OPTIONAL:
            if content[name] is None:
                del content[name]
        return text_of(content)

    @cached_property
    def number(self) -> str:
        """The number of the certificate, which follows from its content."""
        return number_of(self.as_json())


def text_of(stated: Mapping[str, Any]) -> str:
    """Return the text of a ``certificate.json`` with these values: indented JSON and a line end.

    Raises `ValueError` for NaN or an infinite number, and `TypeError` for a value that JSON does
    not have.
    """
    return json.dumps(stated, indent=2, allow_nan=False) + "\n"


def number_of(stated: Mapping[str, Any]) -> str:
    """Return the number of a certificate, 12 hexadecimal digits, from its JSON values.

    The values may have any schema version. The number does not depend on the commit. Raises the
    errors of `text_of`.
    """
    counted = {**stated, "commit": None} if "commit" in stated else stated
    return hashlib.sha256(text_of(counted).encode()).hexdigest()[:12]


def risk_of(metric: MetricStated, verdict: str, *, eligible: bool) -> RiskStated | None:
    """Return the risk of a wrong verdict: its name and its probability, 0 to 1.

    For PASS, it is the probability that the true value is above the limit (false acceptance). For
    FAIL, it is the probability that the true value is at or below the limit (false rejection).
    `eligible` states whether the bat meets all rules other than the limit. The result is None if
    `eligible` is False, if the metric has no value, uncertainty or limit, and for the verdicts
    INVALID and MEASURED.
    """
    value, u, limit = metric.value, metric.u, metric.limit
    if value is None or not u or limit is None or not eligible or verdict not in ("PASS", "FAIL"):
        return None
    dof = inf if metric.dof is None else metric.dof
    conforming = float(conformity(value, u, upper=limit, dof=dof))
    if verdict == "PASS":
        return RiskStated(of="false acceptance", probability=1 - conforming)
    return RiskStated(of="false rejection", probability=conforming)


def statement_of(laboratory: str | None) -> str:
    """Return the sentence on the origin of a result, printed on every page.

    `laboratory` is the name of the laboratory that supplied the records, or None if they are
    simulated.
    """
    return SIMULATED if laboratory is None else SUPPLIED.format(laboratory)


def require_schema(parsed: Mapping[str, Any], where: str) -> None:
    """Raise `InputError` for a certificate with a schema other than `SCHEMA`.

    `parsed` are the JSON values of the certificate. `where` is the name of its file.
    """
    if parsed.get("schema") != SCHEMA:
        allowed = (
            f"allowed: {SCHEMA}, the only schema that this version reads; make the certificate "
            "again with 'virtual-lab reduce RECORDS'"
        )
        raise InputError(where, "schema", parsed.get("schema"), allowed)


def document_of(parsed: dict[str, Any], where: str) -> CertificateDocument:
    """Return the certificate that parsed JSON describes.

    `where` is the name of the file in error messages. Raises `InputError` for another schema, an
    unknown or missing key, a value that is not allowed, or a key that contradicts the others.
    """
    require_schema(parsed, where)
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
        ("metric.impact_position_in", metric.impact_position_in),
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
    sound = document.verdict in ("PASS", "FAIL") and metric.value is not None
    if document.verdict != "INVALID" and document.verdict != (right := _verdict(document, met)):
        yield "verdict", document.verdict, f"by value, limit, findings and flags: {right}"
    exempt = document.verdict == "MEASURED" and metric.limit is not None
    if bool(document.reasons) != (document.verdict in ("FAIL", "INVALID") or exempt):
        allowed = "reasons belong to FAIL, INVALID and an exempt bat, and to no other verdict"
        yield "reasons", "; ".join(document.reasons) or None, allowed
    risk = risk_of(metric, document.verdict, eligible=eligible)
    if not _same_risk(document.risk, risk):
        yield "risk", document.risk and document.risk.probability, f"by the metric: {risk}"
    if document.marginal != (sound and eligible and inside):
        allowed = "true where only the limit decides and lies within interval_95, else false"
        yield "marginal", document.marginal, allowed


def _same_risk(stated: RiskStated | None, computed: RiskStated | None) -> bool:
    if stated is None or computed is None:
        return stated is computed
    close = isclose(stated.probability, computed.probability, rel_tol=1e-6, abs_tol=1e-12)
    return close and stated.of == computed.of


def _verdict(document: CertificateDocument, met: bool) -> str:
    """Return the verdict if the test is valid; `met` states whether the metric meets its limit."""
    if document.metric.value is None or any(flag.invalidates for flag in document.flags):
        return "INVALID"
    if document.bat.construction and document.bat.construction in document.procedure.exempt:
        return "MEASURED"
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
    """Return the certificate in a JSON file.

    Raises `InputError` if the file cannot be read, and for the errors listed in `document_of`.
    """
    return document_of(read_json(path), str(path))
