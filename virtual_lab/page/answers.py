"""The answer of a run in one sentence."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from virtual_lab.output.metrics import METRICS
from virtual_lab.output.rounding import decimals, digits
from virtual_lab.units import MPH


def sentence(command: str, document: Any, text: str) -> str:
    """Return the answer of a command in one sentence, with units and ±.

    A command without a sentence of its own has the first line of its text.
    """
    make = ANSWERS.get(command)
    answer = make(document) if make else ""
    first = next((line.strip() for line in text.splitlines() if line.strip()), "Done")
    return answer or first[:1].upper() + first[1:]


def flags(document: Any) -> list[str]:
    """Return the flags of a certificate or a track, those of a track with their warnings."""
    if not isinstance(document, Mapping):
        return []
    raised = [
        str(each.get("name", each)) if isinstance(each, Mapping) else str(each)
        for each in document.get("flags", ())
    ]
    return [*raised, *(document.get("warnings", ()) if raised else ())]


def _certificate(document: Any) -> str:
    if "verdict" not in document:  # the sheet of a bat, for example
        return ""
    metric, verdict = document["metric"], document["verdict"]
    parts = [] if verdict == "FAIL" else document["reasons"]
    if metric["interval_95"] and verdict != "INVALID":
        printed, limit = METRICS[metric["name"]], metric["limit"]
        value, high = map(printed.in_unit, (metric["value"], metric["interval_95"][1]))
        number = f"{value:.{decimals(high - value)}f} ± {digits(high - value)} {printed.unit}"
        most = "" if limit is None else f", limit {printed.limit(limit)}"
        parts = [f"{printed.symbol} {number.strip()}{most}", *parts]
    return f"{verdict}: {'; '.join(parts)}"


def _score(document: Any) -> str:
    metric = document["metric"]
    inside = "inside" if metric["held"] else "outside"
    return (
        f"The certificate differs from the truth by {metric['error']:+.4g} {metric['unit']}, "
        f"which is {abs(metric['z']):.1f} of its standard uncertainties; the true value "
        f"{metric['true_value']:.4g} is {inside} the 95 % interval"
    ).replace(" ,", ",")


def _track(document: Any) -> str:
    ends = {"in": "start", "out": "end"}
    speeds = [
        (each[f"speed_{end}_m_per_s"]["value"], each[f"speed_{end}_m_per_s"]["u"] or 0.0, end, each)
        for each in document.get("flights") or []
        for end in ends
        if each.get(f"speed_{end}_m_per_s")
    ]
    if not speeds:
        return ""
    speed, u, end, flight = max(speeds, key=lambda each: each[0])
    bounce = flight.get("restitution")
    after = (
        f"; restitution {bounce['value']:.3f} ± {2 * bounce['u']:.3f} after it" if bounce else ""
    )
    return (
        f"Fastest: {speed:.2f} ± {2 * u:.2f} m/s ({speed / MPH:.1f} ± {2 * u / MPH:.1f} mph) "
        f"at the {ends[end]} of flight {flight['flight']}{after}"
    )


def _profile(document: Any) -> str:
    peaks = document.get("peaks") if isinstance(document, Mapping) else None
    if not peaks:
        return ""
    law = peaks[0]["swing_exponent"]
    peaks = [each for each in peaks if each["swing_exponent"] == law]
    most = max(peaks, key=lambda each: each["peak_batted_speed_mph"])
    others = [each for each in peaks if each["bat"] != most["bat"]]
    speed = most["peak_batted_speed_mph"]
    swing = f"swung with a speed proportional to inertia^-{law:g}" if law else "swung equally fast"
    if not others:
        return f"{most['bat']}: batted balls up to {speed:.1f} mph ({speed * MPH:.1f} m/s)"
    less = speed - max(each["peak_batted_speed_mph"] for each in others)
    return (
        f"{most['bat']} hits hardest: batted balls up to {speed:.1f} mph ({speed * MPH:.1f} m/s), "
        f"{less:.1f} mph ({less * MPH:.1f} m/s) more than the next bat, {swing}"
    )


def _operating(document: Any) -> str:
    once = [each for each in document if each["best_of"] == 1]
    if not once:
        return ""
    middle = min(once, key=lambda each: abs(each["pass_probability"] - 0.5))
    least, most = (middle[f"pass_probability_{end}"] for end in ("low", "high"))
    return (
        f"With a true {middle['metric']} of {middle['true_value']:.4g} {middle['unit']} the bat "
        f"passes with a probability of {100 * middle['pass_probability']:.0f} % (95 % interval "
        f"{100 * least:.0f} to {100 * most:.0f} %)"
    ).replace("  ", " ")


def _plan(document: Any) -> str:
    reaching = [each for each in document if each["reaches"] == "yes"]
    if not reaching:
        return "No plan is sure to reach this uncertainty"
    plan = min(reaching, key=lambda each: each["compared"] != "cheapest")
    name = {"present": "The present laboratory"}.get(plan["plan"], f"Plan {plan['plan']}")
    u = f"{plan['simulated_u']:.3g} {plan['unit']}".strip()
    return (
        f"{name} reaches a standard uncertainty of {u}: {plan['hits']} hits, "
        f"{plan['final_hits']} final hits, {plan['balls']} balls, {plan['minutes']:.0f} minutes; "
        f"exchanged: {plan['exchanged']}"
    )


def _verify(document: Any) -> str:
    state = document["state"]
    return "Whole: no file was changed" if state == "whole" else f"The folder is {state}"


def _template(document: Any) -> str:
    forms = document.get("folder")
    return f"Empty forms to fill in are in {forms}" if forms else f"Fill in {document['file']}"


ANSWERS: Mapping[str, Callable[[Any], str]] = {
    "certify": _certificate,
    "reduce": _certificate,
    "show": _certificate,
    "score": _score,
    "verify": _verify,
    "track": _track,
    "profile": _profile,
    "operating": _operating,
    "plan": _plan,
    "template": _template,
}
