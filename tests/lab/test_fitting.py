"""A setup that does not fit is refused before the first shot, in one line with the remedy."""

from contextlib import nullcontext
from pathlib import Path

import pytest

import virtual_lab as vl
from tests.laboratories import certify
from virtual_lab import catalog, lab
from virtual_lab.errors import InputError
from virtual_lab.lab.fitting import identities, require_ball, require_camera
from virtual_lab.simulation.stations.rig import Reality, Stage, find_rig


@pytest.mark.parametrize(
    ("procedure", "rig", "said"),
    [
        ("ncaa-besr", "astm-pivot", "records no swing, which ncaa-besr needs; allowed: ncaa-swing"),
        ("astm-f1881", "ball-cannon", "records no encoder, which astm-f1881 needs"),
        ("bbcor", "ncaa-swing", "swings the bat; bbcor needs it at rest"),
        ("bbcor", "bench", "installed: astm-pivot"),
        ("bbcor", "astm-pivot", r"fires up to 90 mph \(40.23 m/s\)"),
    ],
)
def test_a_rig_that_does_not_fit_is_refused(procedure: str, rig: str, said: str) -> None:
    with pytest.raises(InputError, match=said) as refused:
        certify("r161", procedure=procedure, rig=rig, seed=1)
    assert "\n" not in str(refused.value)


def rules(folder: Path, procedure: str, *changes: tuple[str, str]) -> str:
    text = catalog.find("procedures", procedure).read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "mine.toml").write_text(text, encoding="utf-8")
    return str(folder / "mine.toml")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            ("high = { value = 9,", "high = { value = 28,"),
            r"scan.high = '28 in'; r161 has its axis 28 in from the tip; allowed: between them",
        ),
        (("high = { value = 9,", "high = { value = 40,"), "scan.high = '40 in'"),
        (("low = { value = 3,", "low = { value = 0,"), "scan.low"),
        (("low = { value = 3,", "low = { value = -1,"), "scan.low"),
    ],
)
def test_a_scan_off_the_bat_is_refused(change: tuple[str, str], said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        certify("r161", procedure=rules(tmp_path, "bbcor", change), seed=1)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            (
                "ball_restitution_low = { value = 0.525, unit",
                "ball_restitution_low = { value = 0.554, unit",
            ),
            "windows.ball_restitution = '0.554 to 0.555'; the mean baseball-2003 has 0.55, so",
        ),
        (
            (
                "ball_mass_low = { value = 5.0, unit",
                "ball_mass_low = { value = 5.2, unit",
            ),
            "windows.ball_mass = '5.2 to 5.25 oz'; the mean baseball-2003 has 5.125 oz, so it",
        ),
    ],
)
def test_windows_without_the_nominal_ball_are_refused(
    change: tuple[str, str], said: str, tmp_path: Path
) -> None:
    """Windows that would reject nearly all of twelve balls are refused."""
    with pytest.raises(InputError, match=said):
        certify("r161", procedure=rules(tmp_path, "astm-f1881", change), seed=1)


def test_a_mean_ball_just_outside_the_windows_is_accepted() -> None:
    """A sound laboratory can measure a mean e0 that is off by less than the spread of balls."""
    procedure = vl.procedure("astm-f1881")
    for low, refused in ((0.5525, False), (0.5535, True)):
        stricter = procedure.with_({"windows.ball_restitution_low": low})
        setup = lab.TestSetup.of("r161", procedure=stricter)
        with pytest.raises(InputError) if refused else nullcontext():
            require_ball(setup.rules.spec, setup.ball.spec)


def test_another_rig_that_fits_is_taken(tmp_path: Path) -> None:
    """The gates of the pivoted rig measure the rebound, too, so a scan at 85 mph is possible."""
    slow = rules(tmp_path, "bbcor", ("ball_speed = { value = 136,", "ball_speed = { value = 85,"))
    tested = certify("r161", procedure=slow, rig="astm-pivot", reality=Reality.IDEAL, seed=1)
    found, true = tested.certification, tested.sealed.measurand
    assert found.session.rigs["impact"] == "astm-pivot"
    assert found.hit_weights.reasons == ("",)
    assert found.metric is not None
    assert found.metric.value == pytest.approx(true["metric"], rel=1e-9)


def test_a_rig_without_a_camera_films_nothing() -> None:
    """The refusal comes before the test and names the rig that can film."""
    require_camera(find_rig("filmed-cannon", Stage.IMPACT))
    with pytest.raises(InputError, match="filmed-cannon") as caught:
        require_camera(find_rig("ball-cannon", Stage.IMPACT))
    assert (caught.value.key, caught.value.value) == ("rig", "ball-cannon")


def test_an_instrument_of_two_rigs_has_one_identity() -> None:
    one, both = identities(["astm-pivot"]), identities(["astm-pivot", "bench", "astm-pivot"])
    assert both == one | identities(["bench"])
    assert one["pivot-gates"].identity == "PG-1"
