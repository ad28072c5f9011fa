"""The certificate's page: complete, self-contained, well-formed, and rounded."""

import dataclasses
import re
from collections.abc import Callable, Mapping
from functools import cache
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

from tests.certificate.altering import number_by_hand
from tests.laboratories import certified
from virtual_lab.api import Certificate
from virtual_lab.certificate.document import (
    CameraWord,
    ComparedResult,
    FlagRaised,
    Stated,
    document_of,
    read_document,
)
from virtual_lab.certificate.figures import encoder_figure, hits_figure
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page, notebook_card
from virtual_lab.certificate.schema import json_schema
from virtual_lab.certificate.text import certificate_text
from virtual_lab.errors import InputError
from virtual_lab.measurement.certification import Certification, certify_session
from virtual_lab.output.rounding import digits
from virtual_lab.records.origin import Supplied
from virtual_lab.simulation.stations.rig import Reality

SVG = "{http://www.w3.org/2000/svg}"
NAMESPACES = ("http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink")
HEAVIEST = 60_000  # largest size of one figure [bytes]


def quick(reality: Reality = Reality.REAL) -> Certification:
    """Return one quick test of the wood bat."""
    return certified(seed=7, reality=reality).certification


def scanned(procedure: str) -> Certification:
    """Return one test of the wood bat by a scan along its barrel."""
    return certified(procedure=procedure, seed=7).certification


def again(*changes: tuple[str, str], **fields: object) -> Certification:
    """Return the same records judged by a procedure whose text is changed."""
    session = quick().session
    text = session.procedure_text
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return certify_session(dataclasses.replace(session, procedure_text=text, **fields))


LIMIT, SPEED = "limit = { value = 1.2", "speed_tolerance = { value = 1.0"
HEAVY = """[eligibility]
length_less_weight = { value = 2, unit = "1", source = "assumed", verified = false }

"""


ELSEWHERE = Supplied(laboratory='Crosstown "Bat" Laboratory', customer="Ashwood & Sons")
CASES: Mapping[str, Callable[[], Certification]] = {
    "pass": quick,
    "ideal": lambda: quick(Reality.IDEAL),
    "fail": lambda: again((LIMIT, "limit = { value = 0.8")),
    "marginal": lambda: again((LIMIT, f"limit = {{ value = {quick().metric.value - 0.001:.4f}")),
    "no valid hit": lambda: again((SPEED, "speed_tolerance = { value = 0.001")),
    "too few valid hits": lambda: again(("valid_hits = { value = 6", "valid_hits = { value = 7")),
    "real laboratory": lambda: again(origin=ELSEWHERE),
    "odd name": lambda: again(bat='<b> & "c"'),
    "scan with fresh hits": lambda: scanned("bbcor"),
    "scan and a fitted top": lambda: scanned("ncaa-besr"),
    "scan without a limit": lambda: scanned("proposed"),
}


@cache
def case(name: str) -> Certification:
    """Return a certification of one of the kinds that a page must show."""
    return CASES[name]()


@cache
def page(name: str) -> str:
    return certificate_page(certificate(case(name)))


def words(html: str) -> str:
    """Return the visible text of a page or a card, without the figures."""
    root = ElementTree.fromstring(html.strip())
    for parent in root.iter():
        for child in list(parent):
            if child.tag in (f"{SVG}svg", "style"):
                parent.remove(child)
    return " ".join("".join(root.itertext()).split())


@pytest.mark.parametrize("name", CASES)
def test_a_page_is_well_formed_and_needs_nothing_but_itself(name: str) -> None:
    html = page(name)
    ElementTree.fromstring(html)
    bare = html
    for namespace in NAMESPACES:
        bare = bare.replace(namespace, "")
    assert not re.search(r"https?:|//\w|<script|<link|<img|@import|url\((?!#)", bare)


@pytest.mark.parametrize("name", CASES)
def test_a_page_never_shows_a_missing_value_as_the_computer_writes_it(name: str) -> None:
    """A missing value is a dash or a sentence, on the page and in its figures."""
    text = " ".join(ElementTree.fromstring(page(name)).itertext())
    assert not re.search(r"\b(None|nan|NaN|inf|Undefined)\b", text)


@pytest.mark.parametrize("name", CASES)
def test_a_page_can_be_read_aloud(name: str) -> None:
    """It has a language, ordered headings, scopes, figure titles and unique ids."""
    root = ElementTree.fromstring(page(name))
    assert root.get("lang") == "en"
    levels = [int(e.tag[1]) for e in root.iter() if re.fullmatch(r"h[1-6]", e.tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(after - before <= 1 for before, after in pairwise(levels))
    assert all(head.get("scope") in ("col", "row") for head in root.iter("th"))
    ids = [e.get("id") for e in root.iter() if e.get("id")]
    assert len(ids) == len(set(ids))
    for figure in root.iter("figure"):
        (drawing,) = figure.findall(f"{SVG}svg")
        labels = drawing.get("aria-labelledby", "").split()
        assert labels
        assert set(labels) <= set(ids)
        assert drawing.find(f"{SVG}title") is not None


def test_the_result_is_rounded_by_its_uncertainty() -> None:
    """The expanded uncertainty has two digits, the value the same decimals."""
    metric = quick().metric
    expanded = metric.interval_95[1] - metric.value
    assert 0.00995 < expanded < 0.0995  # two digits of u are three decimals
    said = f"BPF = {metric.value:.3f} ± {expanded:.3f}"
    assert said in words(page("pass"))
    assert f"k = {expanded / metric.u:.2f}" in words(page("pass"))
    assert said in words(notebook_card(certificate(quick())))


@pytest.mark.parametrize(
    ("name", "verdict"),
    [
        ("pass", "PASS"),
        ("fail", "FAIL"),
        ("no valid hit", "INVALID"),
        ("too few valid hits", "INVALID"),
    ],
)
def test_the_page_states_the_verdict_in_words(name: str, verdict: str) -> None:
    card = words(notebook_card(certificate(case(name))))
    assert verdict in words(page(name))
    assert verdict in card


def test_a_fail_names_the_rule_that_is_not_met_and_no_other() -> None:
    """R161: 34 in minus 31.16 oz is 2.8; its BPF of .95 is far below the limit 1.2."""
    heavy = again(("[windows]", f"{HEAVY}[windows]"))
    document = certificate(heavy)
    mass, length = (heavy.bat[name].value for name in ("mass", "length"))
    less = length / 0.0254 - mass / 0.028349523125
    said = f"length in inches minus weight in ounces {less:.2f}, allowed up to 2"
    assert document.verdict == "FAIL"
    assert document.reasons == (said,)
    number = rf"BPF 0\.\d+ ± {digits(document.metric.interval_95[1] - document.metric.value)}"
    first = certificate_text(document).partition("\n")[0]
    assert re.fullmatch(rf"FAIL: {number}, limit 1\.200; {said}", first)
    assert f"The bat does not meet the rules: {said}" in words(notebook_card(document))
    text = words(certificate_page(document))
    assert f"The bat does not meet the rules: {said}" in text
    assert not re.search("exceeds|above the limit|result is (not )?marginal", text)


def test_a_fail_by_the_limit_gives_value_and_limit() -> None:
    value = quick().metric.value
    said = f"BPF {value:.4f} is above the limit 0.800"
    document = certificate(case("fail"))
    assert document.reasons == (said,)
    first = certificate_text(document).partition("\n")[0]
    assert re.fullmatch(rf"FAIL: BPF {value:.3f}\d* ± [\d.]+, limit 0\.800", first)
    for where in (page("fail"), notebook_card(document)):
        assert f"The bat does not meet the rules: {said}" in words(where)
    assert certificate(quick()).reasons == ()


def test_a_bat_that_fails_by_weight_is_not_marginal() -> None:
    """The limit lies within the interval, but another test would give the same verdict."""
    near = (LIMIT, f"limit = {{ value = {quick().metric.value - 0.001:.4f}")
    found = again(near, ("[windows]", f"{HEAVY}[windows]"))
    assert case("marginal").marginal
    assert len(found.reasons) == 2
    assert not found.marginal


def test_verdicts_differ_in_shape_and_not_only_in_color() -> None:
    shapes = {
        re.search(r'<p class="verdict">(.*?)</svg>', page(name), re.DOTALL)[1]
        for name in ("pass", "fail", "no valid hit")
    }
    assert len(shapes) == 3


def test_a_marginal_result_is_said_to_be_and_another_is_not() -> None:
    assert "This result is marginal" in words(page("marginal"))
    assert "This result is not marginal" in words(page("fail"))
    assert "marginal" in words(notebook_card(certificate(case("marginal"))))


@pytest.mark.parametrize(("share", "marginal"), [(0.97, True), (1.03, False)])
@pytest.mark.parametrize("side", [-1, 1])
def test_marginal_is_by_the_interval_and_not_by_u(share: float, side: int, marginal: bool) -> None:
    """Half of the interval is t u = 2.3 u; limits lie just inside and outside, on both sides."""
    metric = quick().metric
    half = metric.interval_95[1] - metric.value
    limit = metric.value + side * share * half
    found = again((LIMIT, f"limit = {{ value = {limit:.9f}"))
    assert half > 2.2 * metric.u
    assert found.marginal == certificate(found).marginal == marginal
    assert found.verdict.value == ("PASS" if side > 0 else "FAIL")


def test_an_invalid_test_states_no_value_and_names_every_reason() -> None:
    text = words(page("no valid hit"))
    assert "No BPF can be stated" in text
    assert "0 valid hits (6 required)" in text
    for reason in case("no valid hit").judgement.reasons:
        assert reason in text


def test_an_invalid_test_with_a_number_shows_it_as_no_result() -> None:
    """The document keeps the mean of five hits, although the procedure requires six."""
    document = certificate(case("too few valid hits"))
    assert document.metric.value is not None
    for form in (words(page("too few valid hits")), certificate_text(document)):
        assert "interval 0." not in form
        assert "BPF =" not in form
    assert "No BPF can be stated" in words(page("too few valid hits"))
    first = certificate_text(document).partition("\n")[0]
    assert first == f"INVALID: {'; '.join(document.reasons)}"
    assert document.text.count(str(document.metric.value)) > 0


def test_a_result_of_supplied_records_never_passes_for_a_simulated_or_verified_one() -> None:
    """The statement is in the head of each page, in text, card and JSON, and nowhere else."""
    said = 'from records supplied by Crosstown "Bat" Laboratory; not verified.'
    document = certificate(case("real laboratory"))
    html = page("real laboratory")
    assert html.count('class="sheet"') == words(html).count(said) == 1
    assert said in words(notebook_card(document))
    assert said in certificate_text(document)
    assert document.as_json()["statement"].endswith(said)
    assert (document.origin, document.simulation) == ("supplied", None)
    assert Certificate(certification=case("real laboratory")).plot().get_supxlabel().endswith(said)
    assert "SIMULATED" not in html + certificate_text(document)
    assert "Seed commitment" not in html
    assert "not verified" in re.search(r"@bottom-left {.*?}", html)[0]
    assert "supplied" not in page("pass")
    assert "SIMULATED" in re.search(r"@bottom-left {.*?}", page("pass"))[0]


@pytest.mark.parametrize("name", ["pass", "scan with fresh hits", "real laboratory"])
def test_the_head_that_print_repeats_names_certificate_and_statement(name: str) -> None:
    """Each printed sheet begins with it."""
    number = number_by_hand(certificate(case(name)).text)
    root = ElementTree.fromstring(page(name))
    sheets = [each for each in root.iter("section") if each.get("class") == "sheet"]
    (sheet,) = sheets
    assert sheet[0].get("class") == "every-page"
    head = " ".join("".join(sheet[0].itertext()).split())
    assert number in head
    assert certificate(case(name)).statement in head
    assert re.search(r"\.every-page \{ display: table-header-group;", page(name))


@pytest.mark.parametrize("name", CASES)
def test_no_word_of_a_figure_is_cut_at_its_edge(name: str) -> None:
    """At 8 pt, letters reach 6 pt above and 2 pt below their baseline."""
    for drawing in ElementTree.fromstring(page(name)).iter(f"{SVG}svg"):
        *_, width, height = map(float, drawing.get("viewBox").split())
        for text in drawing.iter(f"{SVG}text"):
            if "rotate" not in text.get("transform", ""):
                assert 6 <= float(text.get("y")) <= height - 2, "".join(text.itertext())
            assert 0 <= float(text.get("x")) <= width


def test_names_are_escaped() -> None:
    assert "<b>" not in page("odd name")
    assert "&lt;b&gt; &amp;" in page("odd name")
    assert '<b> & "c"' in words(page("odd name"))
    assert "<b>" not in notebook_card(certificate(case("odd name")))


def test_every_shot_and_every_unverified_value_is_listed() -> None:
    certification, text = quick(), words(page("pass"))
    for value in certification.shots.bat_performance_factor:
        assert f"{value:.4f}" in text
    for datum in certification.unverified:
        assert datum.key.replace("windows.", "window.").replace(".", ": ").replace("_", " ") in text


def test_the_budget_speaks_in_words_and_its_shares_add_up() -> None:
    """No known constant is printed under its name in the program."""
    table = re.search(r"Uncertainty budget.*?</table>", page("pass"), re.DOTALL)[0]
    assert not re.search(r"\b(bench|impact|balls|bat)\.", table)
    body = table[: table.index("<tfoot>")]
    shares = [float(share) for share in re.findall(r"<td>([\d.]+)</td></tr>", body)]
    assert sum(shares) == pytest.approx(100, abs=0.05 * len(shares) + 0.01)
    sources = re.findall(r'<th scope="row">(.*?)</th>', body)[:-1]  # the last row: all others
    names = list(Certificate(certification=quick()).budget["source"])
    assert [words(f"<p>{source}</p>") for source in sources] == names[: len(sources)]
    assert len(sources) > 3


def test_a_constant_of_an_unknown_rig_keeps_its_name() -> None:
    document = certificate(quick())
    first, *others = document.budget
    odd = dataclasses.replace(first, component="impact.radar.angle")
    page = certificate_page(dataclasses.replace(document, budget=(odd, *others)))
    assert "impact.radar.angle" in page


def test_the_number_is_the_digest_of_the_certificate_as_saved(tmp_path: object) -> None:
    folder = Certificate(certification=quick()).save(tmp_path / "saved")
    number = number_by_hand((folder / "certificate.json").read_text("utf-8"))
    assert f"No. {number}" in words((folder / "certificate.html").read_text("utf-8"))


@pytest.mark.parametrize("name", ["pass", "ideal", "no valid hit"])
def test_figures_are_light_and_the_same_every_time(name: str) -> None:
    document = certificate(case(name))
    drawings = [hits_figure(document)]
    if document.encoder:
        drawings.append(encoder_figure(document.encoder))
        assert encoder_figure(document.encoder) == drawings[1]
    assert hits_figure(document) == drawings[0]
    for drawing in drawings:
        assert len(drawing.encode()) < HEAVIEST


def test_a_certificate_is_printed_from_its_own_file(tmp_path: Path) -> None:
    """Document, text and page are the same after reading, for every kind of test."""
    for name in CASES:
        document = certificate(case(name))
        path = tmp_path / "certificate.json"
        path.write_text(document.text)
        again = read_document(path)
        assert again == document
        assert certificate_text(again) == certificate_text(document)
        assert certificate_page(again) == page(name)


@pytest.mark.parametrize(
    ("name", "key", "value", "said"),
    [
        ("pass", "schema", 1, "schema = 1; allowed: 7"),
        ("pass", "verdict", "GOOD", "verdict = 'GOOD'"),
        ("pass", "colour", "red", "colour; unknown key"),
        ("pass", "metric.name", "bat_factor", "metric.name = 'bat_factor'.*did you mean bat_perf"),
        ("pass", "metric.unit", "mph", "metric.unit = 'mph'; allowed: ''"),
        ("pass", "metric.u", -1, "metric.u = -1; must be greater than or equal to 0"),
        ("pass", "metric.u", "small", "metric.u = 'small'"),
        ("pass", "metric.value", "0.94", "metric.value = '0.94'.*number"),
        ("pass", "metric.value", None, "metric; needs value, u"),
        ("pass", "metric.value", 1.3, "metric.interval_95 = .* must hold 1.3"),
        ("pass", "metric.limit", 0.8, "verdict = 'PASS'.*: FAIL"),
        ("pass", "metric.limit", None, "verdict = 'PASS'.*: MEASURED"),
        ("pass", "metric.limit", True, "metric.limit = True.*number"),
        ("pass", "verdict", "FAIL", "verdict = 'FAIL'.*: PASS"),
        ("pass", "verdict", "INVALID", "reasons; .* FAIL, INVALID"),
        ("pass", "marginal", True, "marginal = True"),
        ("pass", "marginal", 0, "marginal = 0"),
        ("pass", "findings", [{"sentence": "too heavy", "met": False}], "verdict = 'PASS'.*: FAIL"),
        (
            "pass",
            "flags",
            [{"name": "x", "sentence": "x", "invalidates": True}],
            "verdict = 'PASS'.*: INVALID",
        ),
        ("pass", "restitution.u", -0.001, "restitution.u = -0.001; must be"),
        ("pass", "restitution.value", None, "restitution.*needs value and u, or null for both"),
        ("pass", "v_rel_mph", None, "v_rel_mph; needs a number"),
        ("pass", "valid_hits", "6", "valid_hits = '6'.*integer"),
        ("pass", "statement", "", "statement.*allowed: SIMULATED"),
        ("pass", "origin", "supplied", "simulation; is for the origin 'simulated'"),
        ("pass", "simulation", None, "simulation; is for the origin 'simulated'"),
        ("pass", "simulation", {}, "simulation.*missing"),
        ("pass", "laboratory", "National", "laboratory = 'National'; does not fit"),
        ("real laboratory", "laboratory", "", "laboratory = ''; does not fit"),
        ("real laboratory", "laboratory", "National", "statement.*supplied by National"),
        ("fail", "verdict", "PASS", "verdict = 'PASS'.*: FAIL"),
        ("fail", "reasons", [], "reasons; "),
        ("marginal", "marginal", False, "marginal = False"),
    ],
)
def test_a_certificate_that_contradicts_itself_is_refused(
    name: str, key: str, value: object, said: str
) -> None:
    """One changed value gives one line with file, key, value and allowed values."""
    parsed = certificate(case(name)).as_json()
    assert document_of(parsed, "x.json").as_json() == parsed
    *above, last = key.split(".")
    part = parsed
    for step in above:
        part = part[step]
    part[last] = value
    with pytest.raises(InputError, match=f"^x.json: {said}") as caught:
        document_of(parsed, "x.json")
    assert "\n" not in str(caught.value)


def test_the_schema_of_a_certificate_has_its_name() -> None:
    schema = json_schema()
    assert "CertificateDocument" in schema["title"]
    assert schema["$id"].endswith(":certificate:7")
    assert "2020-12" in schema["$schema"]
    assert schema["additionalProperties"] is False


def test_every_property_of_the_schema_has_a_description() -> None:
    """A field without a docstring, or with one that belongs to another, would fail."""
    schema = json_schema()
    shot = schema["$defs"]["ShotRow"]["properties"]
    metric = schema["$defs"]["MetricStated"]["properties"]
    document = schema["properties"]
    assert shot["recoil_rad_per_s"]["description"].startswith("recoil rate of the bat")
    assert shot["recoil_rad_per_s"]["unit"] == "rad/s"
    assert metric["limit"]["description"].startswith("Largest value that passes")
    assert "unit" not in metric["limit"]
    assert document["air_density_kg_per_m3"]["unit"] == "kg/m3"
    assert document["commit"]["description"].endswith(
        "The certificate's number does not depend on it."
    )
    stated = schema["$defs"]["SimulationStated"]["properties"]
    # description of a field of the base class
    assert stated["seed_commitment"]["description"].startswith("SHA-256 of salt and seed; empty:")
    for definition in (*schema["$defs"].values(), schema):
        assert all(each["description"] for each in definition["properties"].values())


def test_the_page_runs_no_script_and_is_printed_on_the_paper_asked_for() -> None:
    document = certificate(quick())
    page, letter = certificate_page(document), certificate_page(document, "letter")
    assert "default-src 'none'; style-src 'unsafe-inline'" in page
    assert "size: a4 portrait" in page
    assert letter == page.replace("size: a4", "size: letter")


def points(drawing: str, mark: str) -> list[tuple[float, float]]:
    """Return the positions of a kind of mark in a figure [pt]."""
    places = re.findall(rf'<g transform="translate\(([\d.]+),([\d.]+)\)"><{mark} r="2.4"', drawing)
    return [(float(x), float(y)) for x, y in places]


def test_a_figure_shows_the_numbers_to_scale() -> None:
    """Six hits at even steps, with heights in proportion to their metric."""
    document = certificate(quick())
    rows = [row for row in document.shots if not row.reason]
    shown = points(hits_figure(document), "circle")[: len(rows)]
    values = np.array([row.value for row in rows])
    heights = np.array([-y for _, y in shown])
    scaled = (heights - heights.min()) / np.ptp(heights)
    assert scaled == pytest.approx((values - values.min()) / np.ptp(values), abs=0.002)
    steps = np.diff([x for x, _ in shown]) / np.diff([row.shot for row in rows])
    assert np.ptp(steps) < 0.02


def test_the_encoders_figure_shows_the_counts_as_degrees_after_contact() -> None:
    """For the first valid shot of an encoder that counts 1 % too many, by hand from the records.

    One count is 360°/(10 000 × 1.01); the contact is extrapolated from the gates.
    """
    session = quick().session
    known = dict(session.calibration)
    known["impact.encoder.scale"] = dataclasses.replace(known["impact.encoder.scale"], value=1.01)
    trace = certificate(certify_session(dataclasses.replace(session, calibration=known))).encoder
    assert trace is not None
    record, gates = session.records["impact"]["encoder"], session.records["impact"]["gates"]
    far, near = (known[f"impact.gates.distance_{gate}"].value for gate in (0, 1))
    first, last = gates.times[trace.shot, 0].mean(axis=-1)
    after = record.times - last - near * (last - first) / (far - near)
    angle = record.counts[trace.shot] * 360 / 10_000 / 1.01
    assert trace.turn.time_ms == pytest.approx(1e3 * after[::8], abs=6e-5)
    assert trace.turn.angle_deg == pytest.approx(angle[::8], abs=6e-6)
    shown = np.searchsorted(after, np.array(trace.ring.time_ms) / 1e3 - 1e-6)
    assert (after[shown[0]] >= 0) & (after[shown[-1]] <= 0.02)
    assert len(shown) == np.sum((after >= 0) & (after <= 0.02))
    late = np.array(trace.turn.time_ms) > trace.settled_ms
    ring = np.interp(trace.turn.time_ms, trace.ring.time_ms, trace.ring.angle_deg)
    rest = np.array(trace.turn.angle_deg) - trace.turn.fit_deg
    near_contact = late & (np.array(trace.turn.time_ms) < 19)
    assert rest[near_contact] == pytest.approx(ring[near_contact], abs=0.01)
    count = 360 / 10_000
    left = np.array(trace.ring.angle_deg) - trace.ring.fit_deg
    settled = np.array(trace.ring.time_ms) > trace.settled_ms
    assert np.std(left[settled]) < count


def test_the_rebound_check_uses_only_valid_hits() -> None:
    """Two of six shots miss a window of ± 0.5 mph about 60 mph."""
    document = certificate(again((SPEED, "speed_tolerance = { value = 0.5")))
    count = [shot for shot in document.shots if not shot.reason]
    assert len(count) == document.valid_hits == 4
    assert all(shot.rebound_efficiency for shot in document.shots if shot.reason)
    gap = [
        shot.rebound_efficiency - shot.recoil_efficiency
        for shot in count
        if shot.rebound_efficiency is not None
    ]
    check = document.rebound_check
    assert check.shots == len(gap) > 1
    assert check.difference == pytest.approx(np.mean(gap), rel=1e-12)
    assert check.u == pytest.approx(np.std(gap, ddof=1) / len(gap) ** 0.5, rel=1e-12)
    speeds = [shot.speed_mph for shot in count]
    assert document.v_rel_mph == pytest.approx(np.mean(speeds), rel=1e-12)


def test_the_cameras_numbers_stand_on_page_and_text_each_in_its_column() -> None:
    """Every value and u is different, so that none can replace another."""

    def compared(start: float, *, agree: bool) -> ComparedResult:
        values = (Stated(value=start + n / 100, u=0.0011 + 0.0003 * n) for n in range(3))
        gates, video, joined = values
        return ComparedResult(
            gates=gates,
            video=video,
            joined=joined,
            difference=Stated(value=-0.0123, u=0.0045),
            share_of_video=0.4,
            agree=agree,
        )

    camera = CameraWord(
        hits=5,
        missed=2,
        collision_efficiency=compared(0.21, agree=True),
        restitution=compared(0.51, agree=False),
        bat_performance_factor=compared(0.91, agree=True),
    )
    document = dataclasses.replace(certificate(quick()), second_witness=camera)
    root = ElementTree.fromstring(certificate_page(document))
    rows = [["".join(cell.itertext()) for cell in row] for row in root.iter("tr")]
    shown = [row for row in rows if len(row) == 10]
    assert shown[0][0] == "Means of 5 hits"
    for symbol, start, agreed in (("eA", 0.21, "agree"), ("e", 0.51, "disagree")):
        gates, video, joined = (f"{start + n / 100:.4f}" for n in range(3))
        row = [symbol, gates, "0.0011", video, "0.0014", joined, "0.0017", "−0.0123", "0.0045"]
        assert [*row, agreed] in shown
    text = certificate_text(document)
    assert "gates and video for 5 hits, 2 more not measured by video:" in text
    assert (
        "e    gates 0.5100 (u 0.0011), video 0.5200 (u 0.0014), joined 0.5300 (u 0.0017); "
        "DISAGREE, difference −0.0123 (u 0.0045)"
    ) in text
    assert re.search(r"BPF .*joined 0\.9300 \(u 0\.0017\); agree, difference", text)


def test_a_card_is_one_element_of_html() -> None:
    """Notebooks embed the card in their own page."""

    class Depth(HTMLParser):
        depth, roots = 0, 0

        def handle_starttag(self, tag: str, attrs: object) -> None:
            self.roots += self.depth == 0
            self.depth += 1

        def handle_startendtag(self, tag: str, attrs: object) -> None:
            pass

        def handle_endtag(self, tag: str) -> None:
            self.depth -= 1

    counted = Depth()
    counted.feed(notebook_card(certificate(quick())))
    assert (counted.depth, counted.roots) == (0, 1)


def test_the_width_of_a_scan_is_stated_if_the_rules_require_it() -> None:
    """Text and HTML show the number of the document, rounded by its uncertainty."""
    document = certificate(scanned("bbcor"))
    width = document.width_m
    assert width is not None
    assert width.u is not None
    value, u = (f"{number / 0.0254:.3f}" for number in (width.value, width.u))
    assert f"over {value} in (u = {u} in) of the barrel" in words(page("scan with fresh hits"))
    text = certificate_text(document)
    assert f"within 0.01 of the curve's maximum along {value} (u {u}) in of barrel" in text
    assert width.to_in - width.from_in == pytest.approx(width.value / 0.0254)
    assert certificate(scanned("ncaa-besr")).width_m is None
    assert "Width" not in words(page("scan and a fitted top"))


def test_a_width_cut_off_at_an_end_is_at_least_so_much() -> None:
    """The e of a steel cylinder hardly falls along its length: three laboratories of 8 show it."""
    flat = certified("check-cylinder", procedure="bbcor", seed=5).certification
    document = certificate(flat)
    width = document.width_m
    assert width is not None
    assert (width.u, width.at_least) == (None, True)
    least = f"at least {width.value / 0.0254:.2f} in"
    assert least in words(certificate_page(document))
    assert f"{least} of barrel" in certificate_text(document)


@pytest.mark.parametrize("name", ["pass", "scan with fresh hits"])
def test_a_result_says_what_it_is_conditional_on(name: str) -> None:
    """JSON, text and page say it; records of a real laboratory depend on no collision model."""
    document = certificate(case(name))
    sentence = document.conditional_on
    number = len(document.unverified)
    assert "force law alone shifts the peak e of a bat by up to 0.042" in sentence
    assert f"the procedure as implemented here ({number} of its values are unverified)" in sentence
    assert sentence in words(page(name))
    assert sentence in certificate_text(document)
    real = certificate(case("real laboratory")).conditional_on
    assert "force law" not in real
    assert "the procedure as implemented here" in real


def test_the_choice_of_a_position_raises_the_result_and_says_so() -> None:
    """The value is the mean of new hits plus the expected advantage of a neighbor."""
    chosen = scanned("bbcor")
    document = certificate(chosen)
    mean = chosen.shot_metric[chosen.hit_weights.used].mean()
    assert document.choice is not None
    raised = document.choice.correction
    assert raised > 0
    assert document.metric.value == pytest.approx(mean + raised, rel=1e-12)
    (line,) = (row for row in document.budget if row.component == "choice of the place")
    assert line.contribution == pytest.approx(document.choice.u)
    assert "mean of the final hits plus" in words(page("scan with fresh hits"))
    assert "chosen impact position" in certificate_text(document)
    assert certificate(quick()).choice is None
    assert "mean of the final hits plus" not in words(page("pass"))


@pytest.mark.parametrize("name", ["pass", "scan with fresh hits"])
def test_twelve_balls_are_one_line_of_the_budget(name: str) -> None:
    rows = [row.component for row in certificate(case(name)).budget]
    assert rows.count("balls.repeatability") == 1
    assert not [row for row in rows if row.startswith("balls.restitution")]


def test_the_slope_at_the_aim_is_in_the_budget() -> None:
    """BPF = (e_A (1 + r) + r)/e0: its u is (1 + r)/e0 times slope u times the aim's.

    The effect of the aim itself is smaller by the slope.
    """
    budget = {part.name: part for part in quick().metric.components}
    quantities = quick().quantities
    per_e_a = (1 + quantities["recoil_factor"].value) / quantities["ball_restitution"].value
    slope, slope_u = 0.003 / 0.0254, 0.018 / 0.0254
    line, along = budget["procedure.place_slope_error"], budget["impact.cannon.along"]
    aim_u = quick().session.calibration["impact.cannon.along"].u
    assert line.contribution == pytest.approx(per_e_a * slope_u * aim_u, rel=0.02)
    level = again(("place_slope = { value = 0.003", "place_slope = { value = 0.0"))
    plain = {part.name: part for part in level.metric.components}["impact.cannon.along"]
    assert plain.sensitivity - along.sensitivity == pytest.approx(per_e_a * slope, rel=0.02)


def test_the_text_states_everything_that_decides_the_verdict() -> None:
    """Shots and balls count from 1; the risk of a FAIL is that of rejecting a good bat."""
    flag = FlagRaised(name="balls-mixed", sentence="two balls", invalidates=False)
    for name in ("pass", "fail", "marginal", "no valid hit"):
        document = dataclasses.replace(certificate(case(name)), flags=(flag,))
        text = certificate_text(document)
        assert ("marginal: the limit is within" in text) == document.marginal
        assert "FLAG balls-mixed: two balls" in text
        for hit in document.rejected_hits:
            assert f"    shot {hit.shot + 1}: {hit.reason}" in text
        for ball in document.ball.set_aside:
            assert f"  ball {ball.ball + 1} set aside: {ball.reason}" in text
        for reason in document.reasons:
            assert reason in text
        if document.risk:
            side = "exceeds" if document.verdict == "PASS" else "does not exceed"
            assert f"that the true value {side} the limit" in words(certificate_page(document))
    pitches = certificate(quick()).ring.frequencies_hz
    assert len(pitches) > 1
    assert f"at {', '.join(f'{pitch:.0f}' for pitch in pitches)} Hz" in words(page("pass"))
