"""Every option of the commands for a test and its report changes the setting that it names."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import click
import pytest

import virtual_lab as vl
from tests.laboratories import certified
from virtual_lab import api, catalog, lab
from virtual_lab.api import Certificate
from virtual_lab.cli import cli
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import MotionModel, Reality
from virtual_lab.studies import coverage as coverage_study
from virtual_lab.uncertainty.estimate import Estimate

SHARED = {"as_json", "out", "csv", "plot", "config", "instruments"}
Effect = Callable[[Any], object]


class Reached(Exception):  # noqa: N818 no error: the work itself is not done
    """Signal that a command is about to begin its work, with the arguments of that work."""

    def __init__(self, **fields: Any) -> None:
        self.found = SimpleNamespace(**fields)


def reached(*words: str) -> Any:
    """Return the arguments with which a command begins its work."""
    with pytest.raises(Reached) as caught:
        cli.main([*words], standalone_mode=False)
    return caught.value.found


def recorder(name: str, **more: Any) -> Callable[..., Any]:
    def called(*given: Any, **named: Any) -> Any:
        raise Reached(function=name, given=given, **named, **more)

    return called


def options_of(command: str) -> set[str]:
    params = cli.commands[command].params
    return {str(each.name) for each in params if isinstance(each, click.Option)} - SHARED


def stated(setup: lab.TestSetup, key: str) -> object:
    value: object = setup.particulars
    for part in key.split("."):
        value = getattr(value, part)
    return value


# parameter: words, value without them, value with them, and a function that finds the value
CERTIFY: dict[str, tuple[str, object, object, Effect]] = {
    "procedure": ("--procedure bbcor", "astm-f1881", "bbcor", lambda s: s.rules.spec.name),
    "rig": (
        "--procedure bbcor --rig filmed-cannon",
        "astm-pivot",
        "filmed-cannon",
        lambda s: s.rig,
    ),
    "seed": ("--seed 7", None, 7, lambda s: s.seed),
    "number": ("--seed 7 --number 3", 0, 3, lambda s: s.number),
    "reality": ("--reality ideal", Reality.REAL, Reality.IDEAL, lambda s: s.reality),
    "motion": (
        "--motion pymunk",
        MotionModel.CLOSED_FORM,
        MotionModel.PYMUNK,
        lambda s: s.motion,
    ),
    "faults": ("--fault aim-along", (), ("aim-along",), lambda s: tuple(s.faults.names)),
    "control_bat": (
        "--control-bat check-cylinder",
        None,
        "check-cylinder",
        lambda s: s.control_bat and s.control_bat.spec.name,
    ),
    "film": ("--procedure bbcor --rig filmed-cannon --film", False, True, lambda s: s.film),
    "laboratory": (
        "--laboratory lab.toml",
        "",
        "Riverside",
        lambda s: stated(s, "laboratory.name"),
    ),
    "replaces": (
        "--replaces old --reason why",
        None,
        "old",
        lambda s: s.particulars.replaces and s.particulars.replaces.folder,
    ),
    "reason": (
        "--replaces old --reason why",
        None,
        "why",
        lambda s: s.particulars.replaces and s.particulars.replaces.reason,
    ),
    "test": ("--seed 7 --test 2", None, 2, lambda s: s.test),
    "lot": ("--seed 7 --lot 3", None, 3, lambda s: s.lot),
    "history": (
        "--history old --history older",
        [],
        [0.25],
        lambda s: [float(each.value[0]) for each in s.history.values()],
    ),
    "uncertainty": (
        "--uncertainty second-order",
        "first-order",
        "second-order",
        lambda s: s.uncertainty,
    ),
}
SAVED: dict[str, tuple[str, object, object, Effect]] = {
    "pdf": ("--pdf", False, True, lambda c: c.pdf),
    "paper": ("--paper letter", "a4", "letter", lambda c: c.paper),
    "sign": ("--sign key.pem", None, Path("key.pem"), lambda c: c.sign),
}


@pytest.fixture
def begun(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """Stop `certify` where the test begins. The folder ``old`` holds an earlier result."""
    monkeypatch.chdir(tmp_path)
    tested = certified()
    Certificate(certification=tested.certification).save(tmp_path / "old")
    (tmp_path / "lab.toml").write_text('[laboratory]\nname = "Riverside"\n')

    def earlier(folders: Any, *_: Any) -> dict[str, Estimate]:
        assert [*map(str, folders)] in ([], ["old", "older"])
        return {"metric": Estimate(value=0.25)} if folders else {}

    def begin(setup: lab.TestSetup, _progress: Any) -> None:
        raise Reached(setup=setup, texts=catalog.texts_in_place())

    monkeypatch.setattr("virtual_lab.certificate.history.earlier_scatter", earlier)
    monkeypatch.setattr("virtual_lab.lab.certify_bat", begin)
    monkeypatch.setattr("virtual_lab.certificate.signing.require_key", lambda *_, **__: None)
    return tmp_path


def test_each_option_of_certify_reaches_the_test(begun: Path) -> None:
    assert options_of("certify") == CERTIFY.keys() | SAVED.keys()
    plain = reached("certify", "r161").setup
    assert plain.bat.spec.name == "r161"
    for option, (words, without, expected, effect) in CERTIFY.items():
        assert effect(plain) == without, option
        assert effect(reached("certify", "r161", *words.split()).setup) == expected, option
    assert reached("certify", "ea70").setup.bat.spec.name == "ea70"
    vl.instrument("pivot-gates").with_(distance_u="0.73 mm").save("worse.toml")
    request = reached("certify", "r161", "--instrument", "pivot-gates=worse.toml")
    assert "0.73" in request.texts["instruments", "pivot-gates"]


@pytest.mark.parametrize("command", ["certify", "reduce"])
def test_each_option_of_saving_reaches_the_certificate(
    command: str, begun: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other options of `reduce` reach its function."""
    test = Certificate(certification=certified().certification)

    def save(self: Certificate, *_: Any) -> None:
        raise Reached(certificate=self)

    monkeypatch.setattr(Certificate, "save", save)
    arguments: dict[str, Any] = {}

    def made(**named: Any) -> Certificate:
        arguments.update(named)
        return test

    monkeypatch.setattr(api, command, made)
    subject = ["r161"] if command == "certify" else ["old/records", "--out", "new"]
    for option, (words, without, expected, effect) in SAVED.items():
        assert effect(reached(command, *subject).certificate) == without, option
        request = reached(command, *subject, *words.split())
        assert effect(request.certificate) == expected, option
    if command == "reduce":
        assert options_of("reduce") == SAVED.keys() | {"history", "replaces", "reason"}
        words = "--history a --history b --replaces old --reason why"
        reached("reduce", *subject, *words.split())
        assert arguments == {
            "records": Path("old/records"),
            "history": (Path("a"), Path("b")),
            "replaces": Path("old"),
            "reason": "why",
        }


def test_each_option_of_report_reaches_the_report(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(api, "report", recorder("report"))
    assert options_of("report") == {"pdf", "paper"}
    plain, changed = (
        reached("report", "a", "b"),
        reached("report", "a", "--pdf", "--paper", "letter"),
    )
    assert plain.folders == (Path("a"), Path("b"))
    assert (changed.pdf, changed.paper) == (True, "letter")


COVERAGE: dict[str, tuple[str, object, object, Effect]] = {
    "procedure": (
        "--procedure bbcor",
        "astm-f1881",
        "bbcor",
        lambda c: c.given[0].setup.rules.spec.name,
    ),
    "laboratories": ("--laboratories 12", 1000, 12, lambda c: c.given[2]),
    "seed": ("--seed 5", 1, 5, lambda c: c.given[3]),
    "summed": (
        "--summed",
        (RecordDetail.FULL, True),
        (RecordDetail.SUMMED, False),
        lambda c: (c.given[0].setup.detail, c.given[0].setup.random_bat),
    ),
    "individual": ("--summed --individual", True, True, lambda c: c.given[0].setup.random_bat),
    "earlier_tests": ("--earlier-tests 4", 0, 4, lambda c: c.given[0].history),
    "workers": ("--workers 2", 1, 2, lambda c: c.given[4]),
}


def test_each_option_of_coverage_reaches_the_study(monkeypatch: pytest.MonkeyPatch) -> None:
    """With `--individual`, summed records have made bats; `--summed` alone has the nominal bat."""

    def study(*arguments: Any) -> None:
        raise Reached(given=arguments)

    monkeypatch.setattr(coverage_study, "each_laboratory", study)
    assert options_of("coverage") == COVERAGE.keys() | {"laboratory"}  # a folder of sheets
    plain = reached("coverage", "r161")
    for option, (words, without, expected, effect) in COVERAGE.items():
        assert effect(plain) == without, option
        assert effect(reached("coverage", "r161", *words.split())) == expected, option
