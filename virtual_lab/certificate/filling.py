"""From a test's certification to the certificate's document."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, fields, replace
from math import inf, isfinite, sqrt
from typing import cast

import numpy as np
from numpy.polynomial import Polynomial

from virtual_lab.certificate import program
from virtual_lab.certificate.columns import SHOTS
from virtual_lab.certificate.document import (
    SCHEMA,
    AlongBarrel,
    BallSetAside,
    BallsUsed,
    BatAsMeasured,
    BudgetLine,
    CameraWord,
    CertificateDocument,
    ChoiceStated,
    ComparedResult,
    ControlRatio,
    CorrectionStated,
    CurveAlong,
    EncoderTrace,
    FlagRaised,
    HallCondition,
    MetricStated,
    OtherRecoil,
    PlaceRow,
    ProcedureStated,
    ReboundCheck,
    RecoilStated,
    RejectedHit,
    RingRecorded,
    RingStated,
    RuleFinding,
    ShotRow,
    SimulationStated,
    Stated,
    SwingRow,
    Trace,
    UnverifiedValue,
    WidthStated,
    risk_of,
    statement_of,
)
from virtual_lab.measurement.alternatives.refined import LEAST_FREEDOM, low_dof_source
from virtual_lab.measurement.alternatives.swing_range import SwingResult
from virtual_lab.measurement.camera.comparison import CameraComparison, ComparedQuantity
from virtual_lab.measurement.certification import Certification
from virtual_lab.measurement.procedure import CHOICE, curve_of
from virtual_lab.measurement.procedure.metric import field_speeds
from virtual_lab.measurement.procedure.model import AS_FOUND, CONTROL, QUANTITIES
from virtual_lab.measurement.procedure.peak_width import Width
from virtual_lab.measurement.reduction.air import (
    DENSITY,
    climate,
    climate_readings,
    measured_density,
)
from virtual_lab.measurement.reduction.kinematics import batted_speed
from virtual_lab.measurement.reduction.rate import unwrap
from virtual_lab.measurement.reduction.recoil import RECOIL
from virtual_lab.measurement.reduction.shot_algebra import BatProperties
from virtual_lab.output.metrics import METRICS, REBOUND_SPEED
from virtual_lab.output.metrics import QUANTITIES as IN_PRINT
from virtual_lab.records import EncoderRecord
from virtual_lab.records.block import SessionBlock
from virtual_lab.records.origin import Simulated, Supplied
from virtual_lab.records.particulars import Particulars
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.budget import HITS, Budget, Budgets, combine_components
from virtual_lab.uncertainty.monte_carlo import MONTE_CARLO
from virtual_lab.uncertainty.scatter import has_larger_scatter
from virtual_lab.units import INCH, MPH, Array

HISTORY = 10  # number of earlier tests for which a certificate without history states the benefit
HALL_UNITS = {"temperature": "K", "humidity": "1", "pressure": "Pa"}
FEWEST_PLACES = 4  # smallest number of impact positions for a curve along the barrel


def certificate(
    certification: Certification,
    *,
    truth_digest: str | None = None,
    session_digest: str | None = None,
) -> CertificateDocument:
    """Return the certificate of one test.

    Parameters
    ----------
    certification
        Result of the test.
    truth_digest
        SHA-256 of the sealed truth of a simulated test; None without a sealed truth.
    session_digest
        SHA-256 of ``session.json``, which names the records; None if this file was not written.
    """
    session, procedure = certification.session, certification.procedure
    metric, weights = certification.metric, certification.hit_weights
    recoil, judgement = certification.readings.recoil, certification.judgement
    speed = certification.shots.relative_speed[weights.used]
    stated = {
        name: _fill_stated(certification.quantities.get(name))
        for name in QUANTITIES
        if name != procedure.metric or procedure.normalized
    }
    origin = session.origin
    supplied = origin if isinstance(origin, Supplied) else None
    block = certification.block
    air = measured_density(block) or block.calibration.get(DENSITY)
    return CertificateDocument(
        schema=SCHEMA,
        origin="supplied" if supplied else "simulated",
        statement=statement_of(supplied.laboratory if supplied else None),
        procedure=ProcedureStated(
            name=procedure.name,
            title=procedure.title,
            edition=procedure.edition,
            hits_needed=procedure.valid_hits,
            at_percussion=procedure.place == "centre-of-percussion",
            exempt=(procedure.eligibility and procedure.eligibility.exempt) or "",
            swing_exponent=procedure.game.exponent if procedure.game else None,
        ),
        bat=BatAsMeasured(
            name=session.bat,
            construction=session.bat_construction,
            mass_kg=_fill_stated(certification.bat["mass"]),
            length_m=_fill_stated(certification.bat["length"]),
            z_cm_m=_fill_stated(certification.bat["z_cm"]),
            inertia_cm_kg_m2=_fill_stated(certification.bat["inertia_cm"]),
        ),
        ball=BallsUsed(
            name=session.ball,
            ball_restitution_is=_balls_stated(session),
            set_aside=tuple(BallSetAside(**asdict(each)) for each in certification.set_aside),
        ),
        rigs=dict(session.rigs),
        air_density_kg_per_m3=Stated(value=float(air.value[0]), u=float(air.u[0])) if air else None,
        conditions=tuple(_hall_conditions(block)),
        laboratory=supplied.laboratory if supplied else "",
        customer=supplied.customer if supplied else "",
        date=session.date,
        particulars=_particulars(session),
        metric=_metric(certification),
        verdict=certification.verdict.value,
        marginal=certification.marginal,
        risk=risk_of(
            _metric(certification),
            certification.verdict.value,
            eligible=all(each.met for each in certification.findings),
        ),
        decision_rule="The verdict is PASS if the value does not exceed the limit (simple "
        "acceptance) and the bat meets every other rule. A result is called marginal if the "
        "limit is within its 95 % interval",
        **stated,
        recoil=RecoilStated(
            which=procedure.recoil,
            other=OtherRecoil(**asdict(certification.other_support))
            if certification.other_support
            else None,
        ),
        ball_correction=_correction(certification),
        nominal_speed_mph=procedure.ball_speed / MPH,
        nominal_bat_speed_mph=(procedure.bat_speed or 0.0) / MPH,
        v_rel_mph=float(speed.mean() / MPH) if speed.size else None,
        impact_position_in=_finite_or_none(weights.position[0] / INCH),
        width_m=_width(certification.width),
        swing_range=tuple(_swing(result) for result in certification.swings),
        places=tuple(_places(certification)) if procedure.scan else (),
        along=_along(certification) if procedure.scan else None,
        findings=tuple(RuleFinding(**asdict(each)) for each in certification.findings),
        flags=tuple(FlagRaised(**asdict(each)) for each in certification.flags),
        not_checked=certification.not_checked,
        deviations=certification.deviations,
        incomplete=weights.reasons[0],
        reasons=certification.reasons,
        valid_hits=int(judgement.valid.sum()),
        rejected_hits=tuple(
            RejectedHit(shot=shot, reason=reason)
            for shot, reason in enumerate(judgement.reasons)
            if reason
        ),
        shots=tuple(_shots(certification)),
        rebound_check=_rebound_check(certification),
        second_witness=_camera(certification.camera),
        ring=RingStated(
            frequencies_hz=tuple(recoil.ring_frequency.tolist()),
            decays_per_s=tuple(recoil.ring_decay.tolist()),
            fitted_ms=_finite_or_none(1e3 * float(np.fmin.reduce(recoil.span, initial=np.nan))),
        )
        if recoil
        else None,
        encoder=_encoder(certification),
        contact_sheet=tuple(_contact_sheet(certification)),
        choice=_choice(metric),
        conditional_on=_conditional_on(certification),
        budget=tuple(budget_lines(metric)) if metric else (),
        evaluation=f"{_method(certification, metric)} "
        f"{_scatter(certification, certification.first_order)}"
        if metric and certification.first_order
        else "",
        unverified=tuple(
            UnverifiedValue(
                key=datum.key,
                value=f"{datum.value} {datum.unit}".removesuffix(" 1"),
                source=datum.source,
            )
            for datum in certification.unverified
        ),
        simulation=None if supplied else _simulation(cast("Simulated", origin), truth_digest),
        versions=program.versions(),
        commit=program.commit(),
        session_digest=session_digest,
    )


def _particulars(session: Session) -> Particulars:
    """Return the particulars of a session; the supplied records provide names that are missing."""
    particulars, origin = session.particulars, session.origin
    if isinstance(origin, Supplied):
        laboratory, customer = particulars.laboratory, particulars.customer
        laboratory = replace(laboratory, name=laboratory.name or origin.laboratory)
        customer = replace(customer, name=customer.name or origin.customer)
        return replace(particulars, laboratory=laboratory, customer=customer)
    return particulars


def _simulation(origin: Simulated, truth_digest: str | None) -> SimulationStated:
    stated = {each.name: getattr(origin, each.name) for each in fields(origin)}
    return SimulationStated(**stated, truth_digest=truth_digest)


def budget_lines(budget: Budget) -> list[BudgetLine]:
    """Return the components of an uncertainty budget, the largest first, with values in SI units.

    Each component has its share of the variance [%]. All shares are 0 if the variance is 0.
    """
    variance = sum(part.contribution**2 for part in budget.components)
    return [
        BudgetLine(
            component=part.name,
            value=part.value,
            u=part.u,
            evaluation="A" if part.evaluation == "A" else "B",
            dof=_finite_or_none(part.dof),
            sensitivity=part.sensitivity,
            contribution=part.contribution,
            share_percent=100 * part.contribution**2 / variance if variance else 0.0,
        )
        for part in budget.components
    ]


def _metric(certification: Certification) -> MetricStated:
    procedure, metric = certification.procedure, certification.metric
    return MetricStated(
        name=procedure.metric,
        value=metric.value if metric else None,
        u=metric.u if metric else None,
        interval_95=metric.interval_95 if metric else None,
        dof=_finite_or_none(metric.dof) if metric else None,
        u_type_a=metric.u_type_a if metric else None,
        u_type_b=metric.u_type_b if metric else None,
        unit=METRICS[procedure.metric].si_unit,
        limit=procedure.metric_limit,
        impact_position_in=float(certification.hit_weights.position[0] / INCH) if metric else None,
    )


def _shots(certification: Certification) -> list[ShotRow]:
    """Return the shots with those columns of the table that are part of the document."""
    count = len(certification.shots.speed)
    columns = {}
    for column in filter(lambda each: each.row, SHOTS):
        values = column.values(certification)
        plain = [None] * count if values is None else np.asarray(values).tolist()
        columns[column.row] = [
            _finite_or_none(each) if isinstance(each, float) else each for each in plain
        ]
    rows = zip(*columns.values(), strict=True)
    return [ShotRow(**dict(zip(columns, row, strict=True))) for row in rows]


def _places(certification: Certification) -> list[PlaceRow]:
    place, valid = certification.readings.position, certification.judgement.valid
    rows = []
    for at in np.unique(place[valid]):
        hits = certification.shot_metric[valid & (place == at)]
        rows.append(
            PlaceRow(
                impact_position_in=float(at / INCH),
                hits=int(hits.size),
                mean=float(hits.mean()),
                s=float(hits.std(ddof=1)) if hits.size > 1 else None,
            )
        )
    return rows


def _along(certification: Certification) -> AlongBarrel | None:
    """Return e_A, e, a ball speed and the metric along the barrel; None with too few positions.

    The ball speed is v_f, computed for the game speeds of the rules if they state any, otherwise
    for the speeds of the test. For a bat at rest v_f is the rebound speed.
    """
    valid, shots = certification.judgement.valid, certification.shots
    place = certification.readings.position[valid] / INCH
    steps = np.unique(place)
    if steps.size < FEWEST_PLACES:
        return None
    degree = min(5, steps.size - 2)  # same degree as the curve for the width
    along = np.linspace(steps[0], steps[-1], 41)
    rules = certification.procedure
    name, at_rest = rules.metric, rules.game is None and not rules.bat_speed
    quantities = {
        "collision_efficiency": shots.collision_efficiency,
        "restitution": shots.restitution,
        REBOUND_SPEED if at_rest else "batted_speed": _batted_speed(certification),
        name: certification.shot_metric,
    }
    curves = []
    for key, each in quantities.items():
        at = [each[valid][place == step] for step in steps]
        fitted = Polynomial.fit(place, each[valid], degree)(along)
        curves.append(
            CurveAlong(
                name=key,
                unit=IN_PRINT[key].si_unit if key in IN_PRINT else "",
                mean=tuple(float(hits.mean()) for hits in at),
                u=tuple(
                    float(hits.std(ddof=1)) / sqrt(hits.size) if hits.size > 1 else None
                    for hits in at
                ),
                curve=tuple(np.round(fitted, 6).tolist()),
            )
        )
    weights = certification.hit_weights
    top = curve_of(
        certification.procedure,
        certification.readings.position,
        weights.used,
        certification.shot_metric,
    )
    read_at, read = (np.array([]), np.array([])) if top is None else top.linspace(21)
    return AlongBarrel(
        degree=degree,
        curve_in=tuple(np.round(along, 4).tolist()),
        quantities=tuple(curves),
        read_in=tuple(np.round(read_at / INCH, 4).tolist()),
        read=tuple(np.round(read, 6).tolist()),
    )


def _batted_speed(certification: Certification) -> Array:
    """Return v_f of each shot [m/s], shape (shot,).

    It is computed for the game speeds of the rules if they state any, otherwise for the speeds of
    the test.
    """
    properties = {name: np.array(each.value) for name, each in certification.bat.items()}
    # no speed depends on the radius
    bat = BatProperties(**properties, barrel_radius=np.array(np.nan))
    speeds = field_speeds(certification.procedure, certification.readings.position, bat)
    return np.asarray(batted_speed(certification.shots.collision_efficiency, *speeds))


def _camera(comparison: CameraComparison | None) -> CameraWord | None:
    if comparison is None:
        return None
    results = {name: _fill_comparison(each) for name, each in comparison.quantities.items()}
    return CameraWord(
        hits=comparison.hits,
        missed=comparison.missed,
        collision_efficiency=results.get("collision_efficiency"),
        restitution=results.get("restitution"),
        bat_performance_factor=results.get("bat_performance_factor"),
    )


def _fill_comparison(quantity: ComparedQuantity) -> ComparedResult:
    return ComparedResult(
        gates=_fill_stated(quantity.gates),
        video=_fill_stated(quantity.video),
        joined=_fill_stated(quantity.joined),
        difference=_fill_stated(quantity.difference),
        share_of_video=quantity.share,
        agree=quantity.agree,
    )


def _conditional_on(certification: Certification) -> str:
    """Return a sentence with the assumptions behind result and uncertainty."""
    unverified = len(certification.unverified)
    values = "1 of its values is" if unverified == 1 else f"{unverified} of its values are"
    model = (
        "the collision model (the choice of the ball's force law alone shifts the peak e of a bat "
        "by up to 0.042) and on "  # value for r161, from `virtual-lab sensitivity r161`
        if isinstance(certification.session.origin, Simulated)
        else ""
    )
    return (
        f"The result and its uncertainty depend on {model}the procedure as implemented here "
        f"({values} unverified)."
    )


FIRST_ORDER = (
    "The uncertainty is propagated to first order (GUM); the interval uses Student's t with the "
    "effective degrees of freedom of Welch and Satterthwaite."
)


WIDER = (
    "The contributions in the table and their combination are of first order. The u of the draws "
    "is larger, because a t distribution with ν degrees of freedom has a standard deviation of "
    "√(ν/(ν − 2)) times the u of its source."
)


def _method(certification: Certification, metric: Budget) -> str:
    """Return a sentence on the method by which u and interval of the metric were computed."""
    propagated = certification.refined
    few = low_dof_source(metric) if certification.session.uncertainty == MONTE_CARLO else None
    if propagated is None and few is not None:
        return (
            f"The Monte Carlo method was requested but not used: {few.name} has only {few.dof:.1f} "
            f"degrees of freedom, and with fewer than {LEAST_FREEDOM:g} the u of draws from a t "
            f"distribution does not converge. {FIRST_ORDER}"
        )
    if propagated is None:
        return FIRST_ORDER
    outcome = next(iter(propagated.outcomes.values()))
    printed = METRICS[certification.procedure.metric]

    def format_value(value: float, form: str) -> str:
        return printed.text(lambda size: f"{value / size:{form}}")

    shift = format_value(outcome.shift, "+.2g")
    if outcome.convergence is None:
        return (
            "Mean and variance are propagated to second order (GUM 5.1.2, note), which shifts the "
            f"mean by {shift}. {FIRST_ORDER}"
        )
    drawn, within = outcome.convergence.draws, outcome.convergence.tolerance or inf
    return (
        f"The distributions are propagated (JCGM 101) with {drawn:,} draws; u and both ends of the "
        f"interval are accurate to {format_value(within, '.1g')} with 95 % probability. "
        f"The mean of the draws differs from the first-order value by {shift}. {WIDER}"
    )


def _scatter(certification: Certification, linear: Budgets) -> str:
    """Return a sentence on the tests that give the scatter, and on the gain by earlier tests."""
    earlier, today = certification.session.history.get("metric"), certification.variances
    alone = "The scatter of the hits is estimated from this test alone"
    if earlier is None:
        parts = linear.components
        more = np.where(np.array(parts.names) == HITS, 1 + HISTORY, 1)
        longer = combine_components(linear.value, replace(parts, dof=more * parts.dof))
        now, then = (np.ptp(each.row(0).interval_95) for each in (linear, longer))
        less = 1 - then / now if now else 0.0  # an ideal laboratory has no interval
        return (
            f"{alone}. If {HISTORY} earlier tests with the same scatter were included, the "
            f"interval would be {100 * less:.0f} % shorter. If the few hits of this test agree by "
            "chance, the interval is too short."
        )
    if "metric" in today and has_larger_scatter(today["metric"], earlier):
        return (
            f"{alone}, because it is significantly larger than in {earlier.source} (F test, 1 %)."
        )
    return f"The scatter of the hits is estimated from this test and {earlier.source} together."


def _choice(metric: Budget | None) -> ChoiceStated | None:
    """Return the correction for choosing the best position of a scan; None without a scan."""
    parts = [part for part in metric.components if part.name == CHOICE] if metric else []
    return ChoiceStated(correction=parts[0].value, u=parts[0].u) if parts else None


def _fill_stated(budget: Budget | None) -> Stated:
    return Stated(value=budget.value if budget else None, u=budget.u if budget else None)


def _width(width: Width | None) -> WidthStated | None:
    if width is None:
        return None
    whole = width.span.whole
    return WidthStated(
        value=width.budget.value,
        u=width.budget.u if whole else None,
        drop=width.drop,
        at_least=not whole,
        from_in=width.span.low / INCH,
        to_in=width.span.high / INCH,
    )


def _swing(result: SwingResult) -> SwingRow:
    return SwingRow(
        exponent=result.exponent,
        value=result.budget.value,
        u=result.budget.u,
        interval_95=result.budget.interval_95,
        impact_position_in=result.position / INCH,
    )


def _finite_or_none(value: float) -> float | None:
    return float(value) if isfinite(value) else None


def _hall_conditions(hall: SessionBlock) -> Iterator[HallCondition]:
    """Yield the corrected readings of thermometer, hygrometer and barometer at start and end."""
    if record := climate_readings(hall):
        for name, (values, u) in climate(hall, record).items():
            start, end = values[0, [0, -1]].tolist()
            unit = HALL_UNITS[name]
            yield HallCondition(name=name, unit=unit, at_start=start, at_end=end, u=float(u[0, 0]))


def _balls_stated(session: Session) -> str:
    mean = "mean of the admitted balls, each drawn toward the mean of its lot"
    box = f"the balls are from box {session.boxes}, because too few balls of each box before were"
    return mean if session.boxes == 1 else f"{mean}; {box} within the windows"


def _correction(certification: Certification) -> CorrectionStated | None:
    """Return the correction for balls that differ from the standard ball; None if not applied."""
    correction = certification.procedure.correction
    if correction is None or not certification.procedure.normalized:
        return None
    ratio = certification.session.calibration.get(CONTROL)
    control = ControlRatio(value=ratio.value, u=ratio.u, source=ratio.source) if ratio else None
    return CorrectionStated(
        method=correction.method,
        standard=correction.standard,
        control=control,
        as_found=_fill_stated(certification.quantities.get(AS_FOUND)),
    )


def _rebound_check(certification: Certification) -> ReboundCheck | None:
    """Return e_A from the rebound (gates) minus e_A from the recoil (encoder).

    None if nothing measured the recoil.
    """
    if certification.readings.recoil is None:
        return None
    shots, valid = certification.shots, certification.judgement.valid
    measured = valid & np.isfinite(shots.rebound_efficiency)
    if not measured.any():
        return ReboundCheck(shots=0, collision_efficiency=None, difference=None, u=None)
    rebound = shots.rebound_efficiency[measured]
    gap = rebound - shots.recoil_efficiency[measured]
    return ReboundCheck(
        shots=int(measured.sum()),
        collision_efficiency=float(rebound.mean()),
        difference=float(gap.mean()),
        u=float(gap.std(ddof=1)) / sqrt(gap.size) if gap.size > 1 else None,
    )


def _encoder(certification: Certification) -> EncoderTrace | None:
    """Return the encoder record of one shot with fitted curves; None if it has no counts.

    Rotation and vibration are fitted here again for display, with the frequencies and decays that
    the reduction fitted to all shots. No result uses this fit.
    """
    counts, recoil = _counts(certification), certification.readings.recoil
    measured = np.isfinite(certification.shots.speed)
    if counts is None or recoil is None or not measured.any():
        return None
    valid = certification.judgement.valid
    shot = int((valid if valid.any() else measured).argmax())
    after, angle = _angle_of(certification, counts, shot)
    turn, ring = _turn_and_ring(after, angle, recoil.ring_frequency, recoil.ring_decay)
    early = (after >= 0) & (after <= 20e-3)  # a few periods of the slowest vibration
    return EncoderTrace(
        shot=shot,
        settled_ms=RECOIL.settling_time * 1e3,
        turn=_trace(*(each[::8] for each in (after, angle, turn))),
        ring=_trace(after[early], (angle - turn)[early], ring[early]),
    )


def _contact_sheet(certification: Certification) -> Iterator[RingRecorded]:
    """Yield the encoder record of each shot with a speed, minus its rotation; for display only."""
    counts, recoil = _counts(certification), certification.readings.recoil
    if counts is None or recoil is None:
        return
    for shot in np.flatnonzero(np.isfinite(certification.shots.speed)).tolist():
        after, angle = _angle_of(certification, counts, shot)
        early = (after >= -2e-3) & (after <= 50e-3)
        after, angle = after[early], angle[early]
        if not np.any(after > RECOIL.settling_time):
            continue
        turn, _ = _turn_and_ring(after, angle, recoil.ring_frequency, recoil.ring_decay)
        window = (after >= 0) & (after <= 20e-3)
        time, ring = 1e3 * after[window][::2], (angle - turn)[window][::2]  # two samples per period
        yield RingRecorded(
            shot=shot,
            from_ms=round(float(time[0]), 3),
            step_ms=round(float(np.diff(time).mean()), 4),
            angle_deg=tuple(np.round(ring, 3).tolist()),
        )


def _trace(after: Array, angle: Array, fit: Array) -> Trace:
    time, angles, fitted = (
        tuple(np.round(values, places).tolist())
        for values, places in ((after * 1e3, 4), (angle, 5), (fit, 5))
    )
    return Trace(time_ms=time, angle_deg=angles, fit_deg=fitted)


def _counts(certification: Certification) -> EncoderRecord | None:
    """Return the encoder's record as the reduction reads it; None without counts."""
    record = certification.session.records["impact"].get("encoder")
    if not isinstance(record, EncoderRecord):
        return None
    turn = certification.session.calibration["impact.encoder.counts_per_turn"].value
    return unwrap(record, turn, certification.readings.flights.raw.contact)


def _angle_of(
    certification: Certification, record: EncoderRecord, shot: int
) -> tuple[Array, Array]:
    """Return time after contact [s] and angle [°] of one shot, (sample,)."""
    constants = certification.session.calibration
    contact = certification.readings.flights.raw.contact[shot]
    scale, turn = constants["impact.encoder.scale"], constants["impact.encoder.counts_per_turn"]
    return record.times - contact, record.counts[shot] * (360 / (turn.value * scale.value))


def _turn_and_ring(
    after: Array, angle: Array, frequency: Array, decay: Array
) -> tuple[Array, Array]:
    """Return fitted rotation and vibration, (sample,), for known frequencies and decays."""
    fitted = after > RECOIL.settling_time
    columns = [(after / after[-1]) ** power for power in range(RECOIL.polynomial_order + 1)]
    for pitch, loss in zip(frequency, decay, strict=True):
        # no vibration before the contact, where the envelope would overflow
        envelope, phase = np.exp(-loss * np.maximum(after, 0)), 2 * np.pi * pitch * after
        columns += [envelope * np.cos(phase), envelope * np.sin(phase)]
    basis = np.stack(columns, axis=1)
    weights = np.linalg.lstsq(basis[fitted], angle[fitted], rcond=None)[0]
    turns = RECOIL.polynomial_order + 1
    return basis[:, :turns] @ weights[:turns], basis[:, turns:] @ weights[turns:]
