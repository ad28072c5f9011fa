"""A certificate as plain text for a terminal, with one line per printed value."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from virtual_lab.certificate.document import CertificateDocument
from virtual_lab.certificate.printed import printed_values
from virtual_lab.output.tables import table_text


def certificate_text(document: CertificateDocument) -> str:
    """Return the certificate as text of several lines, in printed units."""
    procedure, printed = document.procedure, printed_values(document)
    lines = [_answer(document, printed["result"])]
    lines.append(f"{document.bat.name} by {procedure.name} ({procedure.edition})")
    if document.states_result:
        lines += [f"  {line}" for line in _result(document, printed)]
    rules = {finding.sentence: finding.met for finding in document.findings}
    if document.verdict == "FAIL":
        rules |= dict.fromkeys(document.reasons, False)
    lines += [f"  {'meets' if met else 'does not meet'}: {each}" for each, met in rules.items()]
    lines += [f"  FLAG {flag.name}: {flag.sentence}" for flag in document.flags]
    lines += [f"  {words[0].lower()}{words[1:-1]}" for words in printed["not_checked"]]
    lines.append(f"  valid hits: {document.valid_hits}, rejected: {len(document.rejected_hits)}")
    lines += [f"    shot {hit.shot + 1}: {hit.reason}" for hit in document.rejected_hits]
    lines += [
        f"  ball {each.ball + 1} set aside: {each.reason}" for each in document.ball.set_aside
    ]
    lines += _particulars_lines(document, printed["not_stated"])
    lines += [f"  Deviation: {each}" for each in document.deviations]
    if document.states_result and document.evaluation:
        lines.append(f"  {document.evaluation}")
    lines += [f"  {document.conditional_on}", f"  {document.statement}"]
    if document.simulation:
        lines.append(f"  {document.simulation.sealing}")
    return "\n".join(lines)


def _answer(document: CertificateDocument, result: dict[str, Any]) -> str:
    """Return verdict, result and reasons, such as ``PASS: e 0.483 ± 0.004, limit 0.500``.

    A result above the limit is no further reason here, because both numbers are there.
    """
    unmet = [finding.sentence for finding in document.findings if not finding.met]
    parts = [*(unmet if document.verdict == "FAIL" else document.reasons)]
    if result["stated"]:
        limit = "" if result["limit"] == "none" else f", limit {result['limit']}"
        parts.insert(0, f"{result['symbol']} {result['text']}{limit}")
    parts += ["marginal: the limit is within the 95 % interval"] if document.marginal else []
    return f"{document.verdict}: {'; '.join(parts)}"


def _result(document: CertificateDocument, printed: dict[str, Any]) -> Iterator[str]:
    """Yield the lines of the result and of the other measured quantities."""
    result, at = printed["result"], printed["conditions"]
    most = "no limit" if result["limit"] == "none" else f"limit {result['limit']}"
    first = f", to first order {result['u_first_order']}" if result["u_first_order"] else ""
    value = f"{result['text']} (u {result['u']}{first})"
    factor = f" (k = {result['k']})" if result["uncertain"] else ""
    interval = f"{result['interval']}{factor}"
    yield f"{result['symbol']:4} {value}   95 % interval {interval}, {most}"
    if as_found := printed["as_found"]:
        yield (
            f"{result['symbol']:4} {as_found['text']} (u {as_found['u']})"
            "   as found, with these balls"
        )
    for row in printed["quantities"]:
        symbol = row["symbol"].replace("_0", "0")
        which = {"r": f"   {document.recoil.which}", "e": "   from e_A and r"}.get(symbol, "")
        yield f"{symbol:4} {row['value']} (u {row['u']}){which}"
    yield f"at {at['relative']}, {at['place']} in from the tip"
    if printed["budget"]:
        largest = (f"{line['words']} {line['share']} %" for line in printed["budget"][:3])
        yield f"largest parts of u²: {'; '.join(largest)}"
    if printed["choice"]:
        more = printed["choice"]
        yield f"includes {more} because the chosen impact position may not be the best one"
    if width := printed["width"]:
        along = f"{width['value']} (u {width['u']})" if width["u"] else f"at least {width['value']}"
        where = f"{width['low']} to {width['high']} in from the tip"
        yield f"within {width['drop']} of the curve's maximum along {along} in of barrel, {where}"
    if printed["swings"]:
        yield "for other exponents n of the swing law:"
        title = f"{result['symbol']}, {result['unit']}".removesuffix(", ")
        rows = [
            {
                "n": row["exponent"],
                title: row["value"],
                "u": row["u"],
                "best position, in": row["place"],
            }
            for row in printed["swings"]
        ]
        yield from (f"  {line}" for line in table_text(rows).splitlines())
    if printed["correction"]:
        yield f"the result {printed['correction']}"
    yield from _camera(document, printed["camera"])


def _camera(document: CertificateDocument, rows: list[dict[str, str]]) -> Iterator[str]:
    """Yield the results of the camera for the same hits."""
    camera = document.second_witness
    if camera is None:
        return
    if not camera.hits:
        yield "the camera measured no valid hit"
        return
    missed = f", {camera.missed} more not measured by video" if camera.missed else ""
    yield f"gates and video for {camera.hits} hits{missed}:"
    for row in rows:
        by = ", ".join(f"{method} {row[method]} (u {row[f'{method}_u']})" for method in WAYS)
        agreed = "agree" if row["agree"] == "agree" else "DISAGREE"
        difference = f"difference {row['difference']} (u {row['difference_u']})"
        yield f"  {row['symbol']:4} {by}; {agreed}, {difference}"


WAYS = ("gates", "video", "joined")


def _particulars_lines(document: CertificateDocument, missing: list[str]) -> list[str]:
    """Return the lines on stated and missing particulars; empty if no particular is stated."""
    particulars, simulated = document.particulars, document.simulation is not None
    lines = [
        f"  {words}: {value}" for words, value in particulars.list_statements(simulated=simulated)
    ]
    if lines and missing:
        lines.append(f"  Not stated: {', '.join(missing)}")
    instruments = [f"{name} {each.identity}" for name, each in particulars.instruments.items()]
    return [*lines, f"  Instruments: {', '.join(instruments)}"] if instruments else lines
