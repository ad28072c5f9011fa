"""The command line: exit codes, messages of one line, JSON, and no partial output."""

from __future__ import annotations

import errno
import hashlib
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from datetime import date, timedelta
from pathlib import Path

import click
import pytest

from virtual_lab.cli import cli, main
from virtual_lab.simulation.stations.rig import Stage, installed_rigs

Run = Callable[..., tuple[int, str, str]]
ROOT = Path(__file__).parents[2]


@pytest.fixture
def run(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Run:
    """Return a function that runs the program in an empty folder: exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def call(*words: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["virtual-lab", *words])
        with pytest.raises(SystemExit) as leaving:
            main()
        captured = capsys.readouterr()
        return int(leaving.value.code or 0), captured.out, captured.err

    return call


@pytest.fixture(scope="module")
def piped(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, bytes, bytes]:
    """Return the output folder of one test in a separate process, its stdout and stderr."""
    folder = tmp_path_factory.mktemp("cli") / "r161"
    words = ["certify", "r161", "--seed", "7041776", "--out", str(folder), "--json"]
    command = [sys.executable, "-m", "virtual_lab", *words]
    done = subprocess.run(command, check=True, capture_output=True)
    return folder, done.stdout, done.stderr


@pytest.fixture(scope="module")
def tested(piped: tuple[Path, bytes, bytes]) -> Path:
    """Return the output folder of one test."""
    return piped[0]


def test_certify_writes_all_promised_files(tested: Path) -> None:
    """The folder has the promised files, and the certificate the keys on which programs rely."""
    files = {str(path.relative_to(tested)) for path in tested.rglob("*") if path.is_file()}
    assert {"certificate.html", "certificate.json", "readings.csv"} <= files
    assert {"records/session.json", "records/impact/encoder.csv", "truth/truth.json"} <= files
    certificate = json.loads((tested / "certificate.json").read_text())
    assert {"name", "value", "u", "interval_95", "limit"} <= set(certificate["metric"])
    for name in ("collision_efficiency", "restitution", "recoil_factor", "ball_restitution"):
        assert set(certificate[name]) == {"value", "u"}
    assert certificate["verdict"] == "PASS"
    assert certificate["marginal"] is False
    assert certificate["valid_hits"] == 6
    assert date.fromisoformat(certificate["date"]) <= date.today() + timedelta(days=1)
    assert abs(certificate["v_rel_mph"] - 60) < 1
    assert certificate["metric"]["limit"] == 1.2
    low, high = certificate["metric"]["interval_95"]
    assert low < certificate["metric"]["value"] < high
    assert sorted(path.name for path in tested.parent.iterdir()) == ["r161"]


def test_reduce_gives_the_same_numbers_from_the_records_alone(
    tested: Path, tmp_path: Path, run: Run
) -> None:
    """The numbers are the same bit for bit, in a folder without the truth."""
    shutil.copytree(tested / "records", tmp_path / "theirs")
    code, out, _ = run("reduce", "theirs", "--json")
    certificate = json.loads((tested / "certificate.json").read_text())
    certificate["simulation"]["truth_digest"] = None
    assert code == 0
    assert json.loads(out) == certificate


def test_the_truth_on_disk_changes_only_the_score(tested: Path, tmp_path: Path, run: Run) -> None:
    """Another truth gives the same reduction and a broken seal; without one, only `score` fails."""
    shutil.copytree(tested, tmp_path / "copy")
    before = run("reduce", "copy/records", "--json")
    truth = tmp_path / "copy" / "truth" / "truth.json"
    code, out, _ = run("score", "copy", "--json")
    whole = json.loads(out)
    assert (code, whole["seal"], whole["altered"]) == (0, "whole", [])
    document = json.loads(truth.read_text())
    document["measurand"]["metric"] += 0.1
    truth.write_text(json.dumps(document))
    code, out, _ = run("score", "copy", "--json")
    broken = json.loads(out)
    altered = [(row["file"], row["key"]) for row in broken["altered"]]
    assert (code, broken["seal"]) == (3, "broken")
    assert altered == [("truth/truth.json", "measurand.metric")]
    assert broken["metric"]["error"] == pytest.approx(whole["metric"]["error"] - 0.1)
    assert run("reduce", "copy/records", "--json") == before
    shutil.rmtree(tmp_path / "copy" / "truth")
    code, out, err = run("score", "copy")
    assert (code, out) == (2, "")
    assert "copy/truth/truth.json" in err
    assert run("reduce", "copy/records", "--json") == before


def test_altered_files_are_named(tested: Path, tmp_path: Path, run: Run) -> None:
    """A lower value and a truncated record are named, and the table is still printed."""
    shutil.copytree(tested, tmp_path / "copy")
    path = tmp_path / "copy" / "certificate.json"
    document = json.loads(path.read_text())
    document["metric"]["value"] -= 0.1
    path.write_text(json.dumps(document, indent=2))
    path = tmp_path / "copy" / "records" / "impact" / "encoder.csv"
    path.write_bytes(path.read_bytes()[:4000])
    code, out, _ = run("score", "copy")
    assert code == 3
    assert out.splitlines()[2].startswith("quantity")
    assert "The seal is broken.\naltered\n" in out
    for name in ("certificate.json ", "records/impact/encoder.csv "):
        assert any(line.startswith(name) for line in out.splitlines())
    assert out.splitlines()[-1] == "reproducible: seed chosen, not sealed"
    path = tmp_path / "copy" / "truth" / "seal.json"
    path.unlink()
    code, out, err = run("score", "copy")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "copy/truth/seal.json" in err


def test_show_refuses_a_certificate_that_contradicts_itself(
    tested: Path, tmp_path: Path, run: Run
) -> None:
    """An unknown metric and a PASS above the limit give one line and exit code 2."""
    document = json.loads((tested / "certificate.json").read_text())
    code, shown, _ = run("show", str(tested / "certificate.json"))
    assert (code, shown) == (0, run("show", str(tested))[1])
    code, _, err = run("show", str(tested / "records"))
    assert code == 2
    assert "certificate.json" in err
    for key, value, words in (
        ("name", "bat_factor", "metric.name = 'bat_factor'; did you mean bat_performance_factor?"),
        ("limit", 0.8, "verdict = 'PASS'"),
    ):
        changed = document | {"metric": document["metric"] | {key: value}}
        (tmp_path / "changed.json").write_text(json.dumps(changed))
        code, out, err = run("show", "changed.json")
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert f"changed.json: {words}" in err


def test_a_chosen_seed_is_stated_everywhere(tested: Path, run: Run) -> None:
    words = "reproducible: seed chosen, not sealed"
    assert words in (tested / "certificate.html").read_text()
    document = json.loads((tested / "certificate.json").read_text())
    assert document["simulation"]["sealing"] == words
    assert words in run("reduce", str(tested / "records"))[1].splitlines()[-1]
    assert json.loads(run("score", str(tested), "--json")[1])["sealing"] == words


def test_a_random_seed_is_stored_only_with_the_truth(run: Run, tmp_path: Path) -> None:
    """The seed of 128 bits is in no other file, in no file name and in no message."""
    code, out, err = run("certify", "r161")
    assert code == 0
    assert "sealed: random seed of 128 bits, stored only with the truth" in out.splitlines()[-3]
    truth = json.loads((tmp_path / "out" / "r161-astm-f1881" / "truth" / "truth.json").read_text())
    seed, salt = truth["seed"], bytes.fromhex(truth["salt"])
    assert 2**96 < seed < 2**128  # lower bound: missed by chance once in 4e9
    number, digits = seed.to_bytes(16, "big"), str(seed).encode()
    tells = [digits, number, number[::-1], repr(float(seed))[:12].encode(), salt]
    tells += [
        form
        for each in (number, salt)
        for form in (each.hex().encode(), each.hex().upper().encode())
    ]
    tells += [hashlib.sha256(each).hexdigest()[:16].encode() for each in (digits, number)]
    files = [path for path in (tmp_path / "out").rglob("*") if path.is_file()]
    assert len(files) > 15
    for path in files:
        if path.name != "truth.json":
            data = path.read_bytes() + path.name.encode()
            assert not [each for each in tells if each in data], path
    assert str(seed) not in out + err


def test_score_gives_errors_in_units_and_in_u(tested: Path, run: Run) -> None:
    document = json.loads(run("score", str(tested), "--json")[1])
    for name in ("metric", "collision_efficiency", "restitution", "recoil_factor"):
        row = document[name]
        assert row["error"] == row["value"] - row["true_value"]
        assert row["z"] == pytest.approx(row["error"] / row["u"])
        assert abs(row["z"]) < 4


def test_no_record_and_no_certificate_reveals_the_seed(tested: Path) -> None:
    """The seed 7041776 and its hash without salt are in no file outside the truth."""
    bare = hashlib.sha256(b"7041776").hexdigest()
    for path in tested.rglob("*"):
        if path.is_file() and path.parent.name != "truth":
            text = path.read_text()
            assert "7041776" not in text, path
            assert bare not in text, path
    assert '"seed": 7041776' in (tested / "truth" / "truth.json").read_text()


def test_an_ideal_test_measures_the_truth(run: Run) -> None:
    """Measured and true values agree within 1e-9, and both runs write the same bytes."""
    for name in ("ideal", "again"):
        assert run("certify", "ea70", "--reality", "ideal", "--out", name)[0] == 0
    assert (
        Path("ideal/certificate.html").read_bytes() == Path("again/certificate.html").read_bytes()
    )
    document = json.loads(run("score", "ideal", "--json")[1])
    assert document.pop("sealing") == "reproducible: nothing is random, not sealed"
    assert (document.pop("seal"), document.pop("state")) == ("whole", "whole")
    assert document.pop("faults") == []
    for name, row in ((name, row) for name, row in document.items() if isinstance(row, dict)):
        assert row["value"] == pytest.approx(row["true_value"], rel=1e-9), name


def test_results_go_to_the_first_free_folder(run: Run, tmp_path: Path) -> None:
    for _ in range(2):
        assert run("certify", "r161", "--reality", "ideal")[0] == 0
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [
        "r161-astm-f1881",
        "r161-astm-f1881-2",
    ]


def test_profile_has_the_promised_keys(run: Run) -> None:
    code, out, _ = run("profile", "r161", "--swing", "0.5", "--json")
    document = json.loads(out)
    assert code == 0
    assert document["mass_oz"] == pytest.approx(31, rel=5e-3)  # mass in Table I
    assert document["modal_frequencies_hz"][:2] == pytest.approx([164, 551], rel=5e-3)
    assert document["barrel_nodes_in"] == pytest.approx([6.8, 5.2], abs=0.1)
    speeds = ("bat_speed_mph", "batted_speed_mph")
    curves = ("impact_position_in", "restitution", "recoil_factor", "collision_efficiency", *speeds)
    lengths = {len(document[key]) for key in curves}
    assert len(lengths) == 1


def test_profile_begins_with_its_answer_and_names_ball_and_swing(run: Run) -> None:
    code, out, _ = run("profile", "r161", "--swing", "0.3", "--ball", "baseball-2003")
    assert code == 0
    cells = [line.split() for line in out.splitlines() if line[:1].isdigit()]
    e_A, e_A_place = max((float(row[3]), float(row[0])) for row in cells)
    speed, place = max((float(row[-2]), float(row[0])) for row in cells)
    words = (
        r"r161 hits a ball up to (\S+) mph .* fast, (\S+) in .* e_A is largest, (\S+), at (\S+) in"
    )
    (found,) = re.findall(words, out.splitlines()[0])
    assert [*map(float, found)] == pytest.approx([speed, place, e_A, e_A_place], rel=0.02)
    assert "struck by baseball-2003, swing: n = 0.3" in out


def test_profile_and_compare_write_their_folders(run: Run, tmp_path: Path) -> None:
    assert run("profile", "r161", "--out", "one")[0] == 0
    assert sorted(path.name for path in (tmp_path / "one").iterdir()) == [
        "profile.csv",
        "profile.png",
        "settings.toml",
    ]
    code, out, _ = run("profile", "r161", "softball-34", "--swing", "0.3", "--out", "three")
    assert code == 0
    assert "r161 struck by game-2003; softball-34 struck by softball-slowpitch" in out
    assert (tmp_path / "three" / "compare.png").is_file()
    code, out, _ = run("profile", "r161", "ea70", "--swing", "0.5", "--out", "two", "--json")
    document = json.loads(out)
    assert code == 0
    assert [row["bat"] for row in document["peaks"]] == ["r161", "ea70"]
    assert document["differences"][0]["batted_speed_difference_mph"] == pytest.approx(6, abs=1)
    assert (tmp_path / "two" / "compare.png").is_file()
    code, _, err = run("profile", "r161", "ea70", "--out", "two")
    assert code == 2
    assert "not empty" in err


def test_stability_prints_its_maps_and_writes_its_folder(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from virtual_lab.fidelity import collision_stability

    monkeypatch.setattr(
        collision_stability, "AXES", {collision_stability.CollisionAxis.PLACE: (1.0, 6.0)}
    )
    monkeypatch.setattr(collision_stability, "FACTORS", (1.0, 4.0))
    code, out, _ = run("model", "stability", "collision", "--out", "maps")
    assert code == 0
    assert out.splitlines()[2:7] == [
        "impact position from the tip [in]",
        "step        1    6",
        "1           .    .",
        "4           (X)  (X)",
        "as shipped  .    .",
    ]
    assert sorted(path.name for path in (tmp_path / "maps").iterdir()) == [
        "settings.toml",
        "stability.csv",
        "stability.png",
    ]
    rows = json.loads(run("model", "stability", "collision", "--json")[1])
    assert [row["state"] for row in rows if row["value"] == 1] == ["good", "unstable", "good"]
    code, out, err = run("model", "stability", "collision", "--out", "maps")
    assert (code, out) == (2, "")
    assert "not empty" in err


@pytest.mark.parametrize("kind", [None, "bats", "balls", "procedures", "instruments", "rigs"])
def test_every_listed_sheet_can_be_shown(kind: str | None, run: Run) -> None:
    """Every listed sheet can be shown, and each of its numbers has a unit and a source."""
    rows = json.loads(run("list", *([kind] if kind else []), "--json")[1])
    assert rows
    for row in rows:
        if row["name"] in {"speed-gun-pivot", "radar-range"}:
            continue
        document = json.loads(run("show", row["name"], "--json")[1])
        for number in document["numbers"]:
            assert number["unit"]
            assert number["source"] in document["sources"]


R161 = (ROOT / "data" / "bats" / "r161.toml").read_text()
BAD_BATS = {
    "wrong unit": ('unit = "kg/m^3"', 'unit = "kg"', ["density", "kg/m^3"]),
    "negative": ("value = 644.3", "value = -644.3", ["density", "-644.3", "range 100"]),
    "missing": ("damping_ratio =", "damping =", ["damping"]),
    "not a number": ("value = 644.3", "value = nan", ["density", "finite"]),
    "not monotonic": ("[0, 2, 5, 8,", "[0, 5, 2, 8,", ["profile", "increase"]),
}


@pytest.mark.parametrize("fault", BAD_BATS)
def test_a_bad_file_gives_one_line_and_writes_nothing(fault: str, run: Run, tmp_path: Path) -> None:
    old, new, words = BAD_BATS[fault]
    assert old in R161
    (tmp_path / "mine.toml").write_text(R161.replace(old, new))
    code, out, err = run("certify", "mine.toml", "--out", "out")
    assert (code, out, err.count("\n")) == (2, "", 1)
    for word in ["mine.toml", *words]:
        assert word in err
    assert [path.name for path in tmp_path.iterdir()] == ["mine.toml"]


MEASURED = """name = "mine"
title = "Mine"
template = "wood"
length = { value = 34, unit = "in", source = "rule", verified = true }
mass = { value = 31, unit = "oz", source = "scale", verified = true }
z_cm = { value = 11.3, unit = "in", source = "stand", verified = true }
inertia = { value = 17137, unit = "oz in^2", source = "pendulum", verified = true }
inertia_axis = { value = 33, unit = "in", source = "pendulum", verified = true }
"""


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "value = 31",
            "value = 35.5",
            ["wood", "no bat of this template fits", "misfit of the best one", "the barrel tip"],
        ),
        ('"wood"', '"straw"', ["template", "wood"]),
        ("17137", "137", ["less than mass times"]),
        ('unit = "oz"', 'unit = "in"', ["mass", "oz"]),
        ("z_cm =", "balance =", ["balance", "unknown key", "missing: z_cm", "all keys and units"]),
        (
            'template = "wood"',
            'template = "hollow"\nhoop_modal_mass = { value = 0.4, unit = "kg", source = "tap", '
            "verified = true }",
            ["hoop_modal_mass = '0.4 kg'", "half to twice"],
        ),
    ],
)
def test_measurements_that_fit_no_bat_are_refused(
    old: str, new: str, words: list[str], run: Run, tmp_path: Path
) -> None:
    (tmp_path / "measured.toml").write_text(MEASURED.replace(old, new))
    code, out, err = run("fit-bat", "measured.toml", "--out", "mine.toml")
    said = [line for line in err.splitlines() if not line.startswith("…")]  # but progress
    assert (code, out, len(said)) == (2, "", 1)
    for word in ("measured.toml: ", "'template measurements FILE' writes", *words):
        assert word in err
    assert [path.name for path in tmp_path.iterdir()] == ["measured.toml"]


def test_a_fitted_bat_can_be_profiled(run: Run, tmp_path: Path) -> None:
    (tmp_path / "measured.toml").write_text(MEASURED)
    words = ["fit-bat", "measured.toml", "--out", "mine.toml", "--members", "2"]
    code, out, _ = run(*words, "--json")
    assert code == 0
    assert json.loads(out)["members"] == 2
    document = json.loads(run("profile", "mine.toml", "--json")[1])
    assert document["i_knob_oz_in2"] == pytest.approx(17137, rel=1e-5)
    code, _, err = run(*words)
    assert code == 2
    assert "exists already" in err


def test_daily_prints_its_table_and_writes_its_folder(run: Run, tmp_path: Path) -> None:
    """The command prints its table and its folder; by default it takes the next free folder."""
    short = ("daily", "--days", "12", "--baseline", "6", "--hits", "4")
    code, out, err = run(*short)
    assert (code, [line for line in err.splitlines() if not line.startswith("…")]) == (0, [])
    assert "cumulative sum (CUSUM)" in out
    pictures = [line for line in out.splitlines() if line.startswith("out/")]
    assert pictures == ["out/daily"]
    assert not out.endswith("\n\n")
    document = json.loads(run(*short, "--json")[1])
    assert document["folder"] == "out/daily-2"
    assert len(document["days"]) == 12
    assert (tmp_path / "out" / "daily-2" / "daily.png").is_file()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["certify", "r116"], "did you mean r161?"),
        (["certify", "r161", "--procedure", "astm-f1818"], "did you mean astm-f1881?"),
        (["certify", "r161", "--seed", "-1"], "--seed"),
        (["certify", "r161", "--bogus"], "--bogus"),
        (
            ["certify", "r161", "--reality", "ideal", "--seed", "3"],
            "seed = 3; leave it out: nothing is random",
        ),
        (["certify", "r161", "--reality", "ideal", "--number", "2"], "number = 2; leave it out"),
        (["certify", "r161", "--reality", "noise-free", "--test", "1"], "test = 1; leave it out"),
        (["certify", "nowhere.toml"], "no such file"),
        (["certify", "r161", "--rig", "astm-pivto"], "astm-pivot, ball-cannon"),
        (["certify", "r161", "--rig", "ball-cannon"], "records no encoder, which astm-f1881 needs"),
        (["reduce", "nowhere"], "and no laboratory.toml; template writes empty forms"),
        (["score", "nowhere"], "nowhere/certificate.json"),
        (["show", "r162"], "did you mean r161?"),
        (["profile", "r161", "--swing", "3"], "0 to 0.5"),
        (["profile", "r161", "--ball", "bat"], "allowed: baseball-2003"),
        (["profile", "r161", "--swing", "0", "--swing", "0.5"], "one exponent"),
        (["profile", "r161", "ea7"], "did you mean ea70?"),
        (["profile", "r161", "r161"], "different names"),
        (["profile", "r161", "ea70", "--swing", "nan"], "0 to 0.5"),
        (["sensitivity", "r116"], "did you mean r161?"),
        (["fit-bat", "nowhere.toml", "--out", "mine.toml"], "no such file"),
        (["fit-bat", "nowhere.toml", "--out", "mine"], "ends in .toml"),
        (["fit-bat", "r161", "--out", "mine.toml"], "a .toml file"),
        (["daily", "--days", "3"], "'3'; allowed: one whole number from 6 to 10000"),
        (["list", "hats"], "bats"),
        (["dance"], "dance"),
    ],
)
def test_bad_arguments_give_one_line(words: list[str], said: str, run: Run, tmp_path: Path) -> None:
    code, out, err = run(*words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert said in err
    assert not list(tmp_path.iterdir())


def test_a_folder_in_use_is_left_alone(run: Run, tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("years of work")
    code, _, err = run("certify", "r161", "--out", "full")
    assert code == 2
    assert "not empty" in err
    assert [path.name for path in (tmp_path / "full").iterdir()] == ["thesis.txt"]


def test_a_folder_that_cannot_be_written_is_named(run: Run, tmp_path: Path) -> None:
    """The target is a file, or below one, which stops root, too."""
    (tmp_path / "file").write_text("")
    for target in ("file", "file/inside"):
        code, _, err = run("certify", "r161", "--out", target)
        assert code == 2
        assert target in err


def test_a_truncated_record_is_refused(tested: Path, run: Run, tmp_path: Path) -> None:
    shutil.copytree(tested / "records", tmp_path / "records")
    path = tmp_path / "records" / "impact" / "encoder.csv"
    path.write_bytes(path.read_bytes()[:4000])
    code, out, err = run("reduce", "records")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "records/impact/encoder.csv" in err
    assert "cut short" in err


def test_version_help_and_completion_are_printed(run: Run) -> None:
    from virtual_lab import __version__

    assert run("--version")[1].strip().endswith(__version__)
    assert "certify" in run()[1]
    assert "_VIRTUAL_LAB_COMPLETE" in run("completion", "bash")[1]


def test_the_rig_is_a_choice_and_is_completed(run: Run) -> None:
    """The choices are rigs that fire at bats; the certificate names the chosen one."""
    command = cli.commands["certify"]
    rig = next(option for option in command.params if option.name == "rig")
    context = click.Context(command)
    assert [item.value for item in rig.shell_complete(context, "b")] == ["ball-cannon"]
    impact = {name for name, each in installed_rigs().items() if each.stage is Stage.IMPACT}
    assert {item.value for item in rig.shell_complete(context, "")} == impact
    code, out, _ = run("certify", "r161", "--rig", "astm-pivot", "--seed", "7", "--json")
    assert code == 0
    assert json.loads(out)["rigs"]["impact"] == "astm-pivot"


def test_statements_about_a_test_are_on_its_certificate(run: Run, tmp_path: Path) -> None:
    """Each key fills its line of the certificate, as does its reduction, on the chosen paper."""
    stated = {
        "customer.name": ("Customer", "Hilltop Bats"),
        "bat.serial": ("Serial number of the bat", "SN 4711"),
        "bat.condition": ("Condition of the bat", "two dents"),
        "bat.received": ("Bat received", "2026-11-20"),
        "test.operator": ("Operator", "A. Fuller"),
        "test.notes": ("Notes", "tested on a Monday"),
    }
    lines = [f'{key} = "{value}"' for key, (_, value) in stated.items()]
    (tmp_path / "lab.toml").write_text("\n".join(lines))
    words = ["--seed", "7", "--paper", "letter", "--out", "made", "--laboratory", "lab.toml"]
    assert run("certify", "r161", *words)[0] == 0
    assert run("reduce", "made/records", "--paper", "letter", "--out", "again")[0] == 0
    for folder in ("made", "again"):
        page = (tmp_path / folder / "certificate.html").read_text("utf-8")
        assert re.search(r"@page *\{\s*size: *letter", page)
        text = " ".join(re.sub(r"<[^>]+>", " ", page).split())
        for label, value in stated.values():
            assert f"{label} {value}" in text


def test_a_closed_pipe_is_no_error(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    """In ``virtual-lab list | head -1``, the pipe closes while the program writes."""

    def closed(*_: object, **__: object) -> None:
        raise BrokenPipeError(errno.EPIPE, "Broken pipe")

    monkeypatch.setattr("virtual_lab.cli.commands.click.echo", closed)
    assert run("list")[0] == 0


def test_progress_in_a_pipe_leaves_json_valid(piped: tuple[Path, bytes, bytes]) -> None:
    """Only progress is on stderr, and only if kernels are compiled for ten seconds."""
    _, stdout, stderr = piped
    assert all(line.startswith("… ") for line in stderr.decode().splitlines())
    assert json.loads(stdout)["verdict"] == "PASS"


def test_faults_are_flagged_but_named_only_in_the_truth(run: Run, tmp_path: Path) -> None:
    """Two faults at once raise their flags on the certificate; only the truth names them."""
    words = ["--fault", "aim-across", "--fault", "gate-misses", "--out", "out", "--json"]
    code, out, _ = run("certify", "r161", "--seed", "12", *words)
    assert code == 0
    assert {flag["name"] for flag in json.loads(out)["flags"]} == {"aim", "ball-seen"}
    truth = json.loads((tmp_path / "out" / "truth" / "truth.json").read_text())
    assert truth["faults"] == ["aim-across", "gate-misses"]


def test_an_unknown_fault_is_refused(run: Run, tmp_path: Path) -> None:
    code, _, err = run("certify", "r161", "--fault", "gate-move", "--out", "out")
    assert code == 2
    assert "did you mean gate-moved" in err
    assert not (tmp_path / "out").exists()


def test_faults_prints_its_table_and_writes_its_folder(run: Run, tmp_path: Path) -> None:
    words = ["--procedure", "astm-f1881", "--laboratories", "2", "--seed", "700"]
    code, out, _ = run("faults", "aim-along", *words, "--out", "table")
    assert code == 0
    rows = [line for line in out.splitlines() if line.startswith("astm-f1881")]
    assert [row.split()[1] for row in rows[:2]] == ["none", "aim-along"]
    assert "100% (16% to 100%)" in rows[1]
    assert (tmp_path / "table" / "faults.csv").exists()
    code, out, _ = run("faults", "aim-along", *words, "--json")
    assert [row["fault"] for row in json.loads(out)] == ["none", "aim-along"]


def test_critique_prints_its_tables_and_writes_its_folder(run: Run, tmp_path: Path) -> None:
    words = ("critique", "barrel-loaded", "knob-loaded", "--procedure", "astm-f1881")
    code, out, _ = run(*words, "--swing", "0", "--laboratories", "2", "--out", "two", "--json")
    document = json.loads(out)
    assert code == 0
    assert [row["bat"] for row in document["metrics"]] == ["barrel-loaded", "knob-loaded"]
    assert document["pairs"][0]["batted_speed_difference_mph"] == pytest.approx(6.8, abs=0.5)
    assert (tmp_path / "two" / "critique.png").is_file()
    code, _, err = run(*words, "--out", "two")
    assert code == 2
    assert "not empty" in err


def test_a_missing_extra_is_named_with_the_command_to_install_it(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The message tells how to install it from a clone, because the index has another project."""
    from importlib.metadata import distribution

    monkeypatch.setitem(sys.modules, "uvicorn", None)
    code, _, err = run("rehearse")
    said = "the page needs the extra 'bench'; pip install starlette uvicorn, "
    said += "or in a clone: pip install '.[bench]' or uv run --extra bench …"
    assert (code, err.strip()) == (2, f"virtual-lab: {said}")
    assert distribution("virtual-bat-lab").entry_points.select(name="virtual-lab")
