"""The Python interface: names, changed sheets, sweeps, and the common form of results."""

from __future__ import annotations

import ast
import inspect
import json
import os
import pydoc
import re
import subprocess
import sys
from dataclasses import replace
from datetime import date
from pathlib import Path

import cv2
import numpy as np
import pytest

import virtual_lab as vl
from tests.pictures import lines_of
from virtual_lab import lab
from virtual_lab.api.completing import completions
from virtual_lab.certificate.document import document_of
from virtual_lab.certificate.html import certificate_page
from virtual_lab.cli import cli
from virtual_lab.files.dictionary import column_meaning
from virtual_lab.output import progress as shown_progress
from virtual_lab.simulation.instruments import RecordDetail


def quiet(*_: object) -> None:
    """Show no progress."""


@pytest.fixture(scope="module")
def tested() -> vl.Certificate:
    return vl.certify("r161", seed=7)


def test_dir_help_and_completion_show_the_same_names() -> None:
    """A new interpreter, in which no name has been used yet, shows them all."""
    code = (
        "import virtual_lab as vl; print(*dir(vl));"
        "print([name for name in dir(vl) if not hasattr(vl, name)])"
    )
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    names, missing = done.stdout.splitlines()
    assert missing == "[]"
    commands = {"certify", "score", "reduce", "template", "profile", "sensitivity", "slope"}
    commands |= {"coverage", "bias", "faults", "critique", "daily", "track"}
    assert commands | {"calibrate", "sweep", "fit_bat"} <= set(names.split())
    assert "instruments" in pydoc.render_doc(vl.coverage)
    with pytest.raises(AttributeError):
        vl.nothing  # noqa: B018


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('vl.ball("ga', "game-2003 game-speed-2003"),
        ('vl.certify(vl.bat("r161"), procedure="bb', "bbcor"),
        ("vl.certify(\n    'kn", "knob-loaded"),
        ('vl.certify(bat, faults=["aim-along", "aim-al', "aim-along"),
        ('vl.certify("r161", reality="', "real noise-free ideal"),
        ('vl.certify("r161", nothing="', ""),
        ("vl.bat(ru", ""),
        ('open("', ""),
        ("gates.with_(cl", "clock_fast= clock_u="),
        ("gates.with_(tick=4, half", "half_height="),
        ("gates.with_(tick=", ""),
        ("vl.certify(gates).with_(", ""),
        ('vl.bat("r161").with_(', '{"body.profile.z":'),
        ('vl.bat("r161").with_(seed=1, ', ""),
        ('gates.with_(tick=4); vl.bat("r161").with_({"body.dam', "body.damping_ratio"),
        ('vl.bat("nothing").with_(', ""),
    ],
)
def test_names_and_keys_are_completed(text: str, words: str) -> None:
    found, typed = completions(text, {"gates": vl.instrument("pivot-gates"), "bat": 1})
    assert [*map(str.strip, found)][: len(words.split()) or None] == words.split()
    assert text.endswith(typed)


def test_a_notebook_asks_for_completions() -> None:
    """A fake module has the names of IPython that the package uses; no kernel is started."""
    code = """if True:
        import sys
        from types import SimpleNamespace as Values
        shell = Values(user_ns={}, Completer=Values(custom_matchers=[]))
        sys.modules["IPython"] = Values(get_ipython=lambda: shell)
        import virtual_lab as vl
        (match,) = shell.Completer.custom_matchers
        text = "vl.certify(" + chr(10) + "    bat='knob"
        context = Values(full_text=text + "'", cursor_line=1, text_until_cursor="    bat='knob")
        result = match(context)
        result["completions"] = [each.text for each in result["completions"]]
        print(match.matcher_api_version, result)"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    version, result = done.stdout.split(maxsplit=1)
    found = {"completions": ["knob-loaded"], "matched_fragment": "knob", "suppress": True}
    assert (version, ast.literal_eval(result)) == ("2", found)


def test_the_help_of_the_package_names_every_function_once() -> None:
    """It is grouped by purpose; that of a function stays complete."""
    help_text = pydoc.render_doc(vl, renderer=pydoc.plaintext)
    assert len(help_text.splitlines()) <= 200
    listed = re.findall(r"^ {8}(\w+) {2,}\S", help_text, re.M)
    assert sorted(listed) == sorted({*dir(vl)} - {"__version__"})
    assert set(cli.sections) - {"Shell"} <= set(re.findall(r"^ {4}(\S.*)$", help_text, re.M))
    described_function = pydoc.render_doc(vl.certify, renderer=pydoc.plaintext)
    assert all(f"    {key}\n" in described_function for key in ("control_bat", "uncertainty"))


def described(function: object) -> set[str]:
    """Return the names that the Parameters section of a docstring describes."""
    section = re.search(
        r"Parameters\n-+\n(.*?)(\n\n\S+\n-+\n|\Z)", inspect.getdoc(function) or "", re.S
    )
    lines = section.group(1).splitlines() if section else ()
    return {name.strip() for line in lines if line[:1].strip() for name in line.split(",")}


def test_each_parameter_of_a_public_function_is_described() -> None:
    """A wrapper adds `instruments` to many functions; `certify` describes it."""
    functions = {name: getattr(vl, name) for name in dir(vl)}
    for name, function in functions.items():
        if inspect.isfunction(function):
            parameters = {*inspect.signature(function).parameters, "instruments"}
            assert described(function) | {"instruments"} == parameters, name


def test_the_names_load_nothing_heavy() -> None:
    code = "import sys, virtual_lab.api; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert not {"numpy", "scipy", "numba", "pandas", "click"} & set(done.stdout.split())


@pytest.mark.parametrize(
    ("chosen", "found"),
    [
        ({}, "1"),
        ({"OPENBLAS_NUM_THREADS": "2"}, "2"),
        ({"OMP_NUM_THREADS": "2"}, "None"),  # setting for all libraries with threads
    ],
)
def test_linear_algebra_uses_one_thread_by_default(chosen: dict[str, str], found: str) -> None:
    """The system counts the threads after a QR as large as that of a recoil fit."""
    code = """if True:
        import os, virtual_lab, numpy
        numpy.linalg.qr(numpy.ones((3000, 30)))
        print(os.environ.get("OPENBLAS_NUM_THREADS"), len(os.listdir("/proc/self/task")))"""
    free = {name: value for name, value in os.environ.items() if "_THREADS" not in name}
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, check=True, capture_output=True, text=True, env=free | chosen)
    setting, threads = done.stdout.split()
    assert setting == found
    assert (threads == "1") or chosen


def test_without_a_writable_home_compiled_code_goes_to_a_private_folder(tmp_path: Path) -> None:
    """A second program uses it without a message, unless others can write to the folder."""
    code = """if True:
        import os
        os.access = lambda *_: False  # as of an account without a home, program read-only
        import virtual_lab
        from virtual_lab.uncertainty.budget_kernel import weigh
        print(weigh.stats.cache_path)"""
    free = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    words, free = [sys.executable, "-c", code], free | {"TMPDIR": str(tmp_path)}

    def run() -> tuple[Path, str]:
        done = subprocess.run(words, check=True, capture_output=True, text=True, env=free)
        return Path(done.stdout.strip()).parent, done.stderr

    folder, said = run()
    assert folder.parent == tmp_path
    assert folder.stat().st_mode & 0o777 == 0o700
    assert said.count("\n") == 1
    assert f"no writable home folder: compiled code is in {folder} " in said
    assert run() == (folder, "")
    folder.chmod(0o777)
    another, said = run()
    assert another != folder
    assert str(another) in said


def test_every_long_function_shows_its_progress(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """It is shown on stderr unless a function of the caller takes it."""
    monkeypatch.setattr(shown_progress, "PIPE_STEP", 0.0)
    vl.certify("r161", seed=7)
    assert capsys.readouterr().err.startswith("… ")
    vl.certify("r161", seed=7, progress=quiet)
    assert capsys.readouterr().err == ""
    for name in dir(vl):
        function = getattr(vl, name)
        if inspect.isfunction(function) and "progress" in inspect.signature(function).parameters:
            assert re.search(r"shows?n?\W+(the )?progress|progress\W+is\W+shown", function.__doc__)


def test_a_certificate_has_the_numbers_of_its_document(tested: vl.Certificate) -> None:
    """They are those of ``certificate.json``; a seed that was drawn is not shown."""
    metric = tested.document["metric"]
    assert (tested.value, tested.u) == (metric["value"], metric["u"])
    assert tested.interval == tuple(metric["interval_95"])
    assert (tested.seed, tested.unit) == (7, "")
    assert vl.certify("r161").seed is None
    assert "\n" not in repr(tested)
    assert vl.reduce.__doc__
    speed = vl.certify("r161", procedure="proposed", seed=7)
    assert speed.unit == "mph"
    assert speed.value == pytest.approx(speed.document["metric"]["value"] / 0.44704)


def test_a_certificate_plots_its_hits(tested: vl.Certificate, tmp_path: Path) -> None:
    axes = tested.plot(tmp_path / "hits.png").axes[0]
    assert len(axes.lines[0].get_ydata()) == tested.document["valid_hits"]
    assert (tmp_path / "hits.png").read_bytes().startswith(b"\x89PNG")
    valid = tested.shots["shot"][tested.shots["valid"]]
    assert axes.lines[0].get_xdata().tolist() == (valid + 1).tolist()  # as on the certificate


def test_a_score_plots_its_errors(tested: vl.Certificate, tmp_path: Path) -> None:
    """The errors are in u; a score without rows has a picture without lines."""
    result = vl.score(tested.save(tmp_path / "test"))
    figure = result.plot(tmp_path / "score.png")
    assert figure._repr_png_().startswith(b"\x89PNG")
    tested_rows = [row for row in result.rows if row.z is not None]  # e_A of a hit has no u
    assert [value for _, value, _ in lines_of(figure)] == [row.z for row in tested_rows]
    names = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    hits = tested.shots.query("used")["shot"]
    assert names == ["BPF (result)", "e_A", "e", "r", "e0", *(f"BPF of hit {n + 1}" for n in hits)]
    assert lines_of(replace(result, rows=()).plot()) == []


def test_a_scan_is_plotted_over_the_position_with_its_curve() -> None:
    """The curve passes through the result, which is read from it."""
    scanned = vl.certify("r161", procedure="ncaa-besr", seed=7)
    axes = scanned.plot().axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    shots = scanned.shots
    used = shots["weight"].to_numpy() != 0
    assert axes.get_xlabel() == "impact position from the tip, in"
    assert lines["in the result"].get_xdata().tolist() == shots["impact_position_in"][used].tolist()
    ((place,), (value,)) = lines["impact position of the result"].get_data()
    curve = lines["fitted curve"].get_data()
    assert np.interp(place, *curve) == pytest.approx(scanned.value, abs=2e-5)
    assert value == scanned.value


def test_a_speed_is_stated_in_mph_and_in_m_per_s(tmp_path: Path) -> None:
    """By the score, and by the reason of a test whose u is too large."""
    tested = vl.certify("softball-34", procedure="asa", seed=1)
    tested.save(tmp_path / "test")
    words = vl.score(tmp_path / "test").text.partition("\n")[0]
    si, mph = map(float, re.search(r"true ([\d.]+) m/s \(([\d.]+) mph\)", words).groups())
    assert mph == pytest.approx(si / 0.44704, rel=5e-4)
    rules = vl.procedure("asa").with_(largest_speed_u="0.01 mph")
    reason = vl.certify("softball-34", procedure=rules, seed=1).text.partition("\n")[0]
    stated, limit = r"0\.\d\d mph \(0\.0\d m/s\)", r"0\.01 mph \(0\.00447 m/s\)"
    assert re.fullmatch(f"INVALID: the u of v_f is {stated}, allowed up to {limit}", reason)


def test_a_test_without_a_result_states_the_reason(tmp_path: Path) -> None:
    """A request for a number raises an error; a sweep shows the reason and NaN."""
    rules = vl.procedure("astm-f1881").with_({"windows.speed_tolerance": "0.001 mph"})
    nothing = vl.certify("r161", procedure=rules, seed=2)
    for ask in (nothing.score, lambda: nothing.budget):
        with pytest.raises(vl.InputError, match="gave no result: fewer than two hits were valid"):
            ask()
    with pytest.raises(vl.InputError, match="without the truth"):
        vl.reduce(nothing.save(tmp_path / "test") / "records").score()
    assert "no score: the test has no result" in vl.score(tmp_path / "test").text
    row = vl.sweep("r161", procedures=rules, laboratories=1, seed=2, progress=quiet).iloc[0]
    assert (row["verdict"], row["reason"]) == ("INVALID", "fewer than two hits were valid")
    assert np.isnan([row["value"], row["true_value"], row["restitution_true"]]).all()


def test_a_sweep_states_why_a_bat_fails() -> None:
    """A bat of unknown construction at the limit, 34 in and 31 oz; wood would be exempt."""
    bat = vl.bat("r161").with_(construction=None)
    rules = vl.procedure("bbcor").with_({"eligibility.length_less_weight": 2.5, "limit": 0.4})
    row = vl.sweep(bat, procedures=rules, laboratories=1, seed=0, progress=quiet).iloc[0]
    weight, limit = row["reason"].split("; ")
    assert weight.startswith("length in inches minus weight in ounces 3.0")
    assert weight.endswith(
        "allowed up to 2.5 (one-piece wood bats are exempt, if the construction is stated)"
    )
    assert "above the limit 0.400" in limit
    failing = vl.certify(bat, procedure=rules, seed=0)
    assert failing.reasons[0].startswith("length in inches minus weight in ounces")
    others = vl.procedure("bbcor").with_({"eligibility.length_less_weight": 3.5})
    table = vl.sweep(bat, procedures=others, laboratories=1, seed=0, progress=quiet)
    assert table["reason"][0] == ""
    # the same test of a bat of one-piece wood: only the verdict is another
    exempt = vl.certify("r161", procedure=rules, seed=0)
    said = "no test required: one-piece wood (recalled, unverified)"
    assert (exempt.verdict, exempt.reasons) == ("MEASURED", (said,))
    assert (exempt.value, exempt.u) == (failing.value, failing.u)
    assert said in exempt.text
    assert f"The procedure sets no limit for this bat; {said}." in certificate_page(exempt.printed)
    assert not exempt.document["marginal"]
    with pytest.raises(vl.InputError, match=r"verdict = 'PASS'; by value, limit.*: MEASURED"):
        document_of({**exempt.document, "verdict": "PASS", "reasons": []}, "certificate.json")


def test_a_procedure_may_be_changed_in_a_call(tested: vl.Certificate, tmp_path: Path) -> None:
    """The certificate names the change, and its records alone give the same result."""
    rules = vl.procedure("astm-f1881").with_({"windows.speed_tolerance": "1 m/s"}, valid_hits=9)
    assert rules.spec.windows.speed_tolerance == 1.0
    assert rules.spec.valid_hits == 9
    changed = vl.certify("r161", procedure=rules, seed=7)
    assert changed.document["valid_hits"] == 9
    assert (
        changed.document["procedure"]["name"]
        == "astm-f1881 (windows.speed_tolerance=1 m per s, valid_hits=9)"
    )
    assert changed.document["procedure"]["title"].endswith("windows.speed_tolerance, valid_hits")
    row = rules.numbers.set_index("key").loc["valid_hits"]
    assert (row["source"], row["verified"]) == ("changed", False)
    changed.save(tmp_path / "test")
    again = vl.reduce(tmp_path / "test" / "records")
    assert again.value == changed.value
    rules.save(tmp_path / "mine.toml")
    assert vl.certify("r161", procedure=tmp_path / "mine.toml", seed=7).value == changed.value
    assert vl.certify("r161", procedure=vl.procedure("astm-f1881"), seed=7).value == tested.value


def test_an_instrument_may_be_changed_in_a_call(tested: vl.Certificate) -> None:
    """The u of the gate distances changes in this call only; the next test has the catalog's."""
    worse = vl.instrument("pivot-gates").with_(distance_u="0.73 mm")
    worse_result = vl.certify("r161", instruments=[worse], seed=7)

    def part(certificate: vl.Certificate) -> float:
        return certificate.certification.session.calibration["impact.gates.distance_0"].u

    assert part(worse_result) == pytest.approx(10 * part(tested))
    assert worse_result.u > 1.001 * tested.u
    assert vl.certify("r161", seed=7).value == tested.value


def test_bats_and_balls_may_be_sheets() -> None:
    bat = vl.bat("r161").with_({"body.material.density": 700.0})
    assert bat.spec.body.material.density == 700.0
    heavier = vl.certify(bat, seed=7).document["bat"]
    assert heavier["name"] == "r161 (body.material.density=700.0)"
    assert (
        heavier["mass_kg"]["value"]
        > 1.05 * vl.certify("r161", seed=7).document["bat"]["mass_kg"]["value"]
    )
    ball = vl.ball("baseball-2003").with_(mass="5.2 oz")
    assert vl.profile("r161", ball=ball).document["ball"] == "baseball-2003 (mass=5.2 oz)"
    profiled = vl.profile(bat)
    assert profiled.document["bat"] == "r161 (body.material.density=700.0)"


@pytest.mark.parametrize(
    ("sheet", "changes", "said"),
    [
        ("bat", {"density": 700}, "did you mean body.material.density or spread.density"),
        ("procedure", {"valid_hit": 8}, "did you mean valid_hits?"),
        ("procedure", {"valid_hits": "8 mph"}, "valid_hits"),
        ("procedure", {"valid_hits": "many"}, "a number in 1"),
        ("procedure", {"windows.speed": 1}, "speed"),
        ("procedure", {"gates.tick": 1}, "unknown key"),
        ("procedure", {"limit": None, "nothing": None}, "unknown key"),
        ("procedure", {"attempts": -1}, "attempts"),
        ("bat", {"body.material.density": "7 kg"}, "density"),
        ("instrument", {"distance": 1}, "did you mean distance"),
    ],
)
def test_an_impossible_change_is_refused(sheet: str, changes: dict, said: str) -> None:
    name = {"procedure": "astm-f1881", "bat": "r161", "instrument": "pivot-gates"}[sheet]
    with pytest.raises(vl.InputError, match=said) as caught:
        getattr(vl, sheet)(name).with_(changes)
    assert "\n" not in str(caught.value)
    assert len(caught.traceback) <= 4  # lines of the caller and of the sheet, not of the checks


def test_a_certificate_lists_its_instruments() -> None:
    """An overdue calibration is flagged; the verdict is unchanged."""
    plain = vl.certify("r161", seed=7)
    stated = plain.document["particulars"]["instruments"]
    assert stated["pivot-gates"]["certificate"] == "SIM-PG-1"
    assert stated.keys() >= {"lab-scale", "wall-gates", "pivot-encoder", "hall-air"}
    assert "swing-boards" not in stated
    late = vl.instrument("pivot-gates").with_({"identity.due": "2020-01-01"})
    late_result = vl.certify("r161", seed=7, instruments=[late])
    assert {*late_result.flags} - {*plain.flags} == {"calibration-due"}
    assert (late_result.verdict, late_result.value) == (plain.verdict, plain.value)
    wrong = vl.instrument("pivot-gates").with_({"identity.due": "soon"})
    with pytest.raises(vl.InputError, match="due = 'soon'; must be a day such as"):
        vl.certify("r161", instruments=[wrong])


def test_an_invalid_instrument_is_refused() -> None:
    with pytest.raises(vl.InputError, match="distance_u"):
        vl.certify("r161", instruments=[vl.instrument("pivot-gates").with_(distance_u=-1.0)])
    with pytest.raises(vl.InputError, match="instruments"):
        vl.certify("r161", instruments=["pivot-gates"])  # type: ignore[list-item]


@pytest.mark.parametrize("kind", ["bats", "balls", "procedures", "instruments", "rigs"])
def test_every_sheet_is_written_as_it_was_read(kind: str) -> None:
    from virtual_lab.files import parse_toml
    from virtual_lab.sheets import toml_text

    for row in vl.shelf(kind):
        if row.name in {"speed-gun-pivot", "radar-range"}:
            continue
        sheet = vl.Sheet.of(kind, row.name)
        assert parse_toml(toml_text(sheet.document), "again") == sheet.document
        assert "\n" not in repr(sheet)


def test_a_sweep_is_its_tests_one_by_one() -> None:
    """Laboratories are numbered as in a round robin; units are the printed ones."""
    said: list[tuple[int, int]] = []
    table = vl.sweep(
        "r161",
        procedures=["astm-f1881", "proposed"],
        laboratories=3,
        seed=4,
        progress=lambda _text, done=0, total=0: said.append((done, total)),
    )
    assert said == [(3, 6), (6, 6)]  # blocks: one per procedure
    assert table["laboratory"].tolist() == [0, 1, 2] * 2
    (alone,) = lab.RoundRobin.of("r161", "proposed").run(1, 4, first=1)
    row = table.iloc[4]
    assert row["value"] == pytest.approx(alone.certification.metric.value / 0.44704, rel=1e-12)
    assert row["true_value"] == pytest.approx(alone.sealed.measurand["metric"] / 0.44704, rel=1e-12)
    assert (row["metric"], row["unit"]) == ("v_f", "mph")
    assert row["error"] == pytest.approx(row["value"] - row["true_value"])
    assert row["low"] < row["value"] < row["high"]
    with pytest.raises(vl.InputError, match="seed"):
        vl.sweep("r161", seed=0.5, progress=quiet)  # type: ignore[arg-type]
    with pytest.raises(vl.InputError, match="laboratories"):
        vl.sweep("r161", laboratories=0, progress=quiet)


def test_individual_bats_of_a_sweep_are_those_of_certify() -> None:
    """The records are summed. With the nominal bat, only the balls change the truth."""
    table = vl.sweep("r161", laboratories=6, seed=4, individual=True, progress=quiet)
    setup = lab.TestSetup.of(
        "r161", procedure="astm-f1881", seed=4, number=5, detail=RecordDetail.SUMMED
    )
    alone = lab.certify_bat(setup)
    assert table["value"][5] == alone.certification.metric.value
    assert table["true_value"][5] == alone.sealed.measurand["metric"]
    nominal = vl.sweep("r161", laboratories=6, seed=4, progress=quiet)
    assert table["true_value"].std() > 3 * nominal["true_value"].std()


def test_variants_of_a_sheet_in_one_sweep_are_the_tests_alone() -> None:
    """The oracle is the u of r161, seed 0, with 6, 12 and 24 hits in separate calls."""
    base = vl.procedure("astm-f1881")
    variants = [base.with_(valid_hits=hits, attempts=3 * hits) for hits in (6, 12, 24)]
    said = {"progress": quiet, "laboratories": 1, "seed": 0}
    together = vl.sweep("r161", procedures=variants, **said)
    assert together["u"].round(5).tolist() == [0.00537, 0.00431, 0.00367]
    assert together["procedure"].tolist() == [
        f"astm-f1881 (valid_hits={hits}, attempts={3 * hits})" for hits in (6, 12, 24)
    ]
    assert together["valid_hits"].tolist() == [6, 12, 24]
    assert together["attempts"].tolist() == [18, 36, 72]
    (alone,) = vl.sweep("r161", procedures=variants[1], **said).to_dict("records")
    assert alone == together.iloc[1].to_dict()


def test_a_sweep_has_a_column_for_each_changed_number() -> None:
    """A tolerance of 1 m/s is 2.237 mph, the unit of the sheet."""
    base = vl.procedure("astm-f1881").with_(valid_hits=7)
    key = "windows.speed_tolerance"
    variants = [base.with_({key: width}) for width in ("3 mph", "1 m/s")]
    table = vl.sweep("r161", procedures=variants, laboratories=1, seed=0, progress=quiet)
    assert table[f"{key}_mph"].tolist() == pytest.approx([3, 1 / 0.44704])
    assert table["valid_hits"].tolist() == [7, 7]
    assert table.attrs["units"][f"{key}_mph"] == "mph"
    assert [name for name in table if column_meaning(name) is None] == [f"{key}_mph"]
    assert {*table.attrs["units"]} == {*table.columns}
    bat = vl.bat("r161").with_({"body.material.density": 650})
    variants = [base.with_(limit=1.1), base.with_(limit=None)]  # the second has no limit
    table = vl.sweep(bat, procedures=variants, laboratories=1, seed=0, progress=quiet)
    np.testing.assert_array_equal(table["limit"], [1.1, np.nan])
    assert table.attrs["units"]["body.material.density_kg_per_m3"] == "kg/m^3"


def test_critique_keeps_variants_apart(monkeypatch: pytest.MonkeyPatch) -> None:
    """The metric is the number of hits in the rules, so each variant shows in its own row."""
    from virtual_lab.studies import critique

    def hits(tested: lab.BlockTest) -> np.ndarray:
        setup = tested.laboratory.setup
        return np.full(setup.count, float(setup.rules.spec.valid_hits))

    monkeypatch.setattr(critique, "_metrics", hits)
    variants = [vl.procedure("astm-f1881").with_(valid_hits=hits) for hits in (6, 12)]
    result = vl.critique(["r161", "ea70"], procedures=variants, laboratories=2)
    assert {row.procedure: row.mean for row in result.metrics} == {
        "astm-f1881 (valid_hits=6)": 6.0,
        "astm-f1881 (valid_hits=12)": 12.0,
    }
    assert "(3)" not in result.text


def test_the_name_of_a_changed_sheet_can_name_a_file(tmp_path: Path) -> None:
    rules = vl.procedure("astm-f1881").with_({"windows.speed_tolerance": "1 m/s"})
    assert rules.name == "astm-f1881 (windows.speed_tolerance=1 m per s)"
    again = rules.with_(valid_hits=8).with_(valid_hits=9)
    assert again.name == "astm-f1881 (windows.speed_tolerance=1 m per s, valid_hits=9)"
    places = np.linspace(0, 34, 12)
    long = vl.bat("r161").with_({"title": "a/b<c>|d", "body.profile.z": places})
    other = vl.bat("r161").with_({"title": "a/b<c>|d", "body.profile.z": places * 0.99})
    assert len({long.name, other.name}) == 2
    assert len(long.name) == 100
    assert long.name.endswith(")")
    assert (tmp_path / long.name).write_text("") == 0
    assert not set('/\\<>:"|?*') & set(long.name)
    with pytest.raises(vl.InputError, match="an entry of the catalog"):
        rules.with_(name="bbcor")


def test_entries_of_one_name_in_one_call_are_refused(tmp_path: Path) -> None:
    first, second = (
        vl.procedure("astm-f1881").with_(name="mine", valid_hits=hits) for hits in (6, 9)
    )
    with pytest.raises(vl.InputError, match="two different sheets have this name"):
        vl.sweep("r161", procedures=[first, second], laboratories=1)
    paths = [each.save(tmp_path / f"{each.spec.valid_hits}.toml") for each in (first, second)]
    with pytest.raises(vl.InputError, match="'mine'; is given twice"):
        vl.sweep("r161", procedures=paths, laboratories=1)
    gates = [vl.instrument("pivot-gates"), vl.instrument("pivot-gates").with_(tick="2 us")]
    with pytest.raises(vl.InputError, match="pivot-gates"):
        vl.certify("r161", instruments=gates)


def test_an_instrument_of_no_rig_in_the_test_is_refused() -> None:
    """The instruments in use are those that the rigs read, also for a rig of another package."""
    camera = vl.instrument("camera-overhead").with_({"sensor.pixel": "20 um"})
    with pytest.raises(vl.InputError, match=r"camera-overhead.*in use: .*pivot-gates") as caught:
        vl.sweep("r161", laboratories=1, seed=0, instruments=[camera], progress=quiet)
    assert "light-boards" not in str(caught.value)
    with pytest.raises(vl.InputError, match="in use: none"):
        vl.profile("r161", instruments=[camera])


WRONG_CALLS = {  # calls with a mistake, and a part of the message that states the correct form
    "vl.certify(None)": r"bat = None; allowed: a bat: its name \(vl.shelf\('bats'\)\), a .toml",
    "vl.certify(['r161', 'ea70'])": "allowed: a bat: its name",
    "vl.certify('r161', seed=True)": "one whole number from 0 .*; for several, vl.sweep",
    "vl.certify('r161', seed=-1)": "one whole number from 0",
    "vl.certify('r161', 'bbcor')": r"argument 2 = 'bbcor'; write it by name: procedure=…",
    "vl.certify()": "bat; is missing",
    "vl.certify('r161', procedures='bbcor')": "unknown argument, did you mean procedure",
    "vl.certify(vl.procedure('bbcor'))": "allowed: a bat",
    "vl.certify('r161', film='yes')": "True or False",
    "vl.certify('r161', faults=3)": "names of faults",
    "vl.certify('r161', reality='idael')": "did you mean ideal",
    "vl.certify('r161', uncertainty='mote-carlo')": "did you mean monte-carlo",
    "vl.certify('r161', reality=None)": "real, noise-free or ideal",
    "vl.sweep('r161', procedure='bbcor')": "did you mean procedures",
    "vl.sweep('r161', laboratories=[5])": "whole number",
    "vl.sweep([])": "at least one",
    "vl.sweep({'r161'})": "or a list",
    "vl.sweep(['r161', 'r161'])": "given twice",
    "vl.score(tested)": r"has a function of its own: write .score\(\) after it",
    "vl.reduce(tested)": "the path of a folder",
    "vl.shelf('bat')": "did you mean bats",
    "vl.Sheet.of('bat', 'r161')": "did you mean bats",
    "vl.bat(None)": "a name, or a path",
    "vl.critique('r161')": "bats = 'r161'; allowed: at least two",
    "vl.slope('r161', 'ea70')": r"several bats are one list, \[A, B\]; or write it by name",
    "vl.profile('r161', 3)": "bats = .*allowed: a bat",
    "vl.profile('r161', more='ea70')": "more; unknown argument",
    "vl.certify('r161', laboratory={'customr': {}})": "laboratory: customr; unknown key, did you",
    "vl.certify('r161', laboratory={'bat': {'received': 'x'}})": "bat.received = 'x'; must be a",
    "vl.certify('r161', laboratory={3: {}})": "laboratory: 3; Keys must be strings",
    "vl.certify('r161', laboratory={'customer': 3})": "customer = 3; must be",
    "vl.certify('r161', laboratory=3)": "a file of particulars, its keys and values, or the fold",
    "vl.critique(['r161', 'ea70'], procedures=[])": "at least one",
    "vl.critique(['r161', 'ea70'], procedures=['bbcor', 'bbcor'])": "'bbcor'; is given twice",
    "vl.faults(procedures=[vl.procedure('bbcor').with_(valid_hits=9)])": (
        r"procedure = 'bbcor \(valid_hits=9\)'; these faults have predictions for astm-f1881, bbcor"
    ),
    "vl.profile('r161', ball=0.073)": "ball = 0.073; allowed: a ball",
    "vl.profile('r161', swing=0.5)": "did you mean swings",
    "vl.coverage('r161', laboratories=2.5)": "whole number",
    "vl.certify('r161', seed=2**128)": r"seed = 3402\d+; allowed: .*0 to 2\^128 - 1",
    "vl.certify('r161', seed=10**5000)": "seed = a number of thousands of digits; allowed",
    "vl.sweep('r161', laboratories=10**5000)": "laboratories = a number of thousands of digits",
    "vl.coverage('r161', workers=0)": "workers = 0; allowed: one whole number from 1",
    "vl.campaign({'bats': 'r161'}, 'c', workers=0)": "workers = 0; .*one whole number from 1",
    "vl.campaign({'change': {'x': [10**5000]}}, 'c')": "value = a number of thousands of digits",
    "vl.daily(progress=3)": "a function that is called with a sentence",
    "vl.daily(drift='1')": "drift = '1'; allowed: a number",
    "vl.calibrate('x.png', board=3)": "charuco:14x9",
    "vl.procedure('bbcor').with_(['valid_hits'])": "keys and values",
    "vl.procedure('bbcor').with_(name='')": "allowed: a string",
    "vl.procedure('bbcor').with_(ball=vl.ball('game-2003'))": "strings, files, numbers",
    "vl.coverage(instruments=[vl.ball('game-2003')])": r"; a ball: procedure.with_\(ball=FILE",
    "vl.coverage(instruments=['game-2003=x.toml'])": "among the balls; a procedure names its ball",
}


@pytest.mark.parametrize("call", WRONG_CALLS)
def test_the_message_of_a_wrong_call_states_the_correct_form(
    call: str, tested: vl.Certificate
) -> None:
    with pytest.raises(vl.InputError, match=WRONG_CALLS[call]) as caught:
        eval(call, {"vl": vl, "tested": tested})
    assert "\n" not in str(caught.value)


def test_arguments_may_have_equivalent_forms(tested: vl.Certificate) -> None:
    """One instrument without a list, numpy types, a path for a name, a rig as a sheet."""
    gates = vl.instrument("pivot-gates")
    assert vl.certify("r161", seed=np.uint8(7), instruments=gates).value == tested.value
    rig = vl.rig("astm-pivot").with_({"pivot.from_knob": "152 mm"})
    assert vl.certify(Path("r161"), seed=7, rig=rig).value == tested.value
    table = vl.sweep(np.array(["r161"]), laboratories=np.int64(2), progress=quiet)
    assert table["laboratory"].tolist() == [0, 1]


def test_several_bats_may_be_written_one_by_one(tmp_path: Path) -> None:
    """The result, and its file of settings, are those of a list."""
    listed, bat = vl.profile(["r161", "ea70"]), vl.bat("ea70")
    for result in (vl.profile("r161", "ea70"), vl.profile(["r161"], bat), vl.profile("r161", bat)):
        assert result.text == listed.text
        assert 'bats = ["r161", "ea70"]' in result.settings
    pair = {"procedures": ["bbcor"], "laboratories": 2}
    assert vl.critique("r161", "ea70", **pair).text == vl.critique(["r161", "ea70"], **pair).text
    table = vl.sweep("r161", "ea70", laboratories=1, progress=quiet)
    assert table["bat"].tolist() == ["r161", "ea70"]


def test_particulars_may_be_keys_and_values(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """They give the certificate of a file with the same keys; a logo is a path."""
    cv2.imwrite(str(tmp_path / "logo.png"), np.zeros((9, 9), np.uint8))
    monkeypatch.chdir(tmp_path)
    keys = {
        "laboratory": {"name": "Bat Laboratory", "logo": "logo.png"},
        "bat": {"received": date(2026, 11, 20)},
        "instruments": {"gates": {"identity": "G-12"}},
        "customer": {"name": "Oak"},
    }
    Path("lab.toml").write_text(
        "[laboratory]\nname = 'Bat Laboratory'\nlogo = 'logo.png'\n[bat]\nreceived = 2026-11-20\n"
        "[instruments.gates]\nidentity = 'G-12'\n[customer]\nname = 'Oak'\n"
    )
    stated, filed = (
        vl.certify("r161", seed=7, laboratory=each).document["particulars"]
        for each in (keys, "lab.toml")
    )
    assert stated == filed
    assert stated["customer"]["name"] == "Oak"
    assert stated["laboratory"]["logo"].startswith("data:image/png")


def test_every_public_function_reads_its_arguments() -> None:
    for name in dir(vl):
        function = getattr(vl, name)
        if callable(function) and not isinstance(function, type):
            with pytest.raises(vl.InputError, match="nonsense; unknown argument"):
                function(nonsense=1)


def test_a_seed_may_be_a_numpy_integer() -> None:
    """The result is that of the same Python integer."""
    setup = lab.TestSetup.of("ea70", procedure="astm-f1881", seed=3)
    plain = lab.certify_bat(setup).certification.metric.value
    assert vl.certify("ea70", seed=np.int64(3)).value == plain


def test_the_repr_of_a_result_is_short() -> None:
    """A table indexed by a name refers to `.table`; the result of `show` is its text."""
    assert repr(vl.show("bbcor")).startswith("bbcor: Ball-bat coefficient of restitution")
    with pytest.raises(vl.InputError, match=r"\.table has columns by name"):
        vl.shelf("bats")["r161"]
    nested = vl.bat("r161").with_({"body.material": {"density": 700}})
    assert nested.name == "r161 (body.material.density=700)"


def test_results_of_studies_have_one_shape(tmp_path: Path) -> None:
    result = vl.slope()
    assert repr(result) == (
        "<slope of e_A along the barrel at the impact position of astm-f1881, 6 rows>"
    )
    assert result.table["bat"].tolist()[-2:] == ["mean", "deviation"]
    assert json.dumps(result.document)
    result.save(tmp_path / "slope")
    with pytest.raises(vl.InputError, match="is not empty"):
        result.save(tmp_path / "slope")
    (tmp_path / "slope/old.txt").write_text("old")
    result.save(tmp_path / "slope", overwrite=True)
    files = {path.name for path in (tmp_path / "slope").iterdir()}
    assert files == {"settings.toml", "slope.csv", "slope.png"}
    with pytest.raises(vl.InputError, match="no picture"):
        vl.shelf("bats").plot(tmp_path / "bats.png")


def test_a_sheet_refuses_a_value_that_toml_cannot_hold() -> None:
    from virtual_lab.sheets import toml_text

    for value in (None, {1, 2}, [None]):
        with pytest.raises(vl.InputError, match="cannot be written in a sheet; allowed: strings"):
            toml_text({"key": value})


def test_bad_input_is_one_line_in_a_notebook() -> None:
    """IPython prints what `_render_traceback_` returns in place of the traceback."""
    with pytest.raises(vl.InputError) as fault:
        vl.certify("r16")
    (line,) = fault.value._render_traceback_()
    assert line == f"InputError: {fault.value}"
    assert "\n" not in line


def test_a_notebook_shows_what_the_text_says(tmp_path: Path) -> None:
    """The display of a table has its title and words; another result shows its text."""
    shown = vl.shelf("bats")._repr_html_()
    assert "<td>r161</td>" in shown
    vl.certify("r161", seed=7).save(tmp_path / "out")
    assert "<pre>whole: no file was changed\n" in vl.verify(tmp_path / "out")._repr_html_()
    risks = vl.risk(vl.Input(0.230, 0.004), 0.0014, upper=0.235)
    assert "consumer's risk" in repr(risks)
