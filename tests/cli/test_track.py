"""`virtual-lab track` on a clip of a known ball: files, JSON, and messages of one line."""

import csv
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import cv2
import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

import virtual_lab as vl
from tests.video.once import searching_once
from tests.video.scenery.filming import film
from tests.video.scenery.scenes import SCENES
from tests.video.scenes import Film, write_video
from virtual_lab.cli import cli
from virtual_lab.errors import InputError

FILM = Film(before=12.4, count=30)
FRAMES = np.zeros((3, 20, 20), np.uint8)


def refusal_of(*words: str) -> str:
    """Return the sentence with which a command refuses its input."""
    with pytest.raises((InputError, click.UsageError)) as refused:
        cli.main(words, standalone_mode=False)
    return str(refused.value)


@pytest.fixture(scope="module", autouse=True)
def watched_once() -> Iterator[None]:
    """Search each clip once, because most tests concern later steps."""
    with searching_once():
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    at = tmp_path_factory.mktemp("track")
    write_video(at / "clip.mp4", list(FILM.frames()), 5000)
    (at / "cal.toml").write_text(
        "frames_per_second = 5000\nexposure_s = 2e-5\nlens_blur_px = 0.7\n"
    )
    return at


def test_track_writes_all_files_and_results(folder: Path) -> None:
    out = folder / "found"
    arguments = ["track", str(folder / "clip.mp4"), "--calibration", str(folder / "cal.toml")]
    done = CliRunner().invoke(
        cli, [*arguments, "--ball", "28mm±0.1mm", "--film-of-track", "--out", str(out), "--json"]
    )
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    assert document.pop("folder") == str(out)
    assert document == json.loads((out / "result.json").read_text())
    speed, true = document["speed_in_m_per_s"], np.hypot(*FILM.velocity_in) * 5.0
    assert speed.keys() == {"value", "u"}
    assert abs(speed["value"] - true) < 2 * speed["u"] < 0.02 * true
    assert document["speed_out_m_per_s"].keys() == document["restitution"].keys() == {"value", "u"}
    assert document["flags"] == []
    assert document["warnings"] == []
    assert document["counts"] == {"frames": 30, "with_ball": 30, "lost": 0}
    assert [each["positions"] for each in document["flights"]] == [13, 17]
    assert sorted(path.name for path in out.iterdir()) == [
        "result.json", "settings.toml", "sheet.png", "speeds.csv", "track.csv", "track.png",
        "track.webp",
    ]  # fmt: skip
    rows = list(csv.DictReader((out / "track.csv").read_text().splitlines()))
    assert len(rows) == 30
    x, _ = FILM.places()
    np.testing.assert_allclose([float(row["x_px"]) for row in rows], x, atol=0.05)
    assert {row["flight"] for row in rows} == {"1", "2"}
    fast = [np.hypot(float(row["right_m_per_s"]), float(row["up_m_per_s"])) for row in rows]
    assert fast[0] == pytest.approx(true, rel=0.01)
    flights = list(csv.DictReader((out / "speeds.csv").read_text().splitlines()))
    assert float(flights[0]["speed_out_m_per_s"]) == pytest.approx(speed["value"], rel=1e-5)
    assert float(flights[0]["restitution"]) == pytest.approx(
        document["restitution"]["value"], rel=1e-5
    )
    assert flights[1]["contact_kind"] == ""
    for name, least in (("track.png", 600), ("sheet.png", 1200)):
        picture = cv2.imread(str(out / name))
        assert picture is not None
        assert picture.shape[1] > least
        assert picture.std() > 10
    _, film = cv2.imreadanimation(str(out / "track.webp"))
    assert len(film.frames) == 30
    rows, columns = next(iter(FILM.frames())).shape[:2]
    assert film.frames[0].shape[:2] == (rows + 24, columns + 4)  # with caption and border


def test_options_replace_the_calibration_file(folder: Path, tmp_path: Path) -> None:
    """Scale with its u, frame rate and exposure in options replace the file's, also for a hit."""
    words = "frames_per_second = 5000\nexposure_s = 1e-4\nlens_blur_px = 0.7\n"
    (folder / "other.toml").write_text(words)
    options = ["--scale", "100,50:200,50=20cm±2mm", "--fps", "2500", "--exposure", "20us"]
    arguments = ["track", str(folder / "clip.mp4"), "--calibration", str(folder / "other.toml")]
    done = CliRunner().invoke(cli, [*arguments, *options, "--out", str(tmp_path), "--json"])
    assert done.exit_code == 0, done.output
    document = json.loads(done.stdout)
    u = np.hypot(0.01, np.sqrt(2) / 100)
    assert document["scale"].pop("checks") == []
    assert document["scale"].pop("roll_deg") is None
    assert document["scale"] == pytest.approx(
        {"metres_per_pixel": 2e-3, "relative_u": u, "from": "given"}
    )
    pixels = np.hypot(*FILM.velocity_in)
    assert document["speed_in_m_per_s"]["value"] == pytest.approx(pixels * 2e-3 * 2500, rel=2e-3)
    assert document["speed_in_m_per_s"]["u"] == pytest.approx(u * pixels * 5, rel=0.05)
    assert document["exposure_s"] == pytest.approx(2e-5)
    assert (tmp_path / "sheet.png").exists()
    assert not (tmp_path / "track.webp").exists()  # film, which was not requested


def test_the_balls_u_is_in_the_speeds_of_a_hit(folder: Path) -> None:
    for ball, share in (("28mm±1mm", 1 / 28), ("28mm", 0.01)):
        track = vl.track(folder / "clip.mp4", calibration=folder / "cal.toml", ball=ball)
        document = track.document
        assert document["scale"]["relative_u"] == pytest.approx(share, rel=0.1)
        assert ("0.28 mm was assumed" in track.text) == (ball == "28mm")
        assert document["speed_in_m_per_s"]["u"] > share * document["speed_in_m_per_s"]["value"]


def test_a_track_shows_its_picture(folder: Path, tmp_path: Path) -> None:
    """It has every position of a flight, and is that of the result folder."""
    track = vl.track(folder / "clip.mp4", calibration=folder / "cal.toml", ball="28mm")
    figure = track.plot(tmp_path / "own.png")
    assert figure._repr_png_().startswith(b"\x89PNG")
    flights = [each for each in figure.axes[0].lines if str(each.get_label()).startswith("flight")]
    assert sum(len(each.get_xdata()) for each in flights) == (track.places["flight"] != "").sum()
    (tmp_path / "found").mkdir()
    (tmp_path / "found/settings.toml").touch()  # an earlier result
    track.save(tmp_path / "found", overwrite=True)
    stored, own = (cv2.imread(str(tmp_path / name)) for name in ("found/track.png", "own.png"))
    assert (stored == own).all()


# baseball: diameter from its circumference, and drag with C_d 0.45, k = ρ C_d A / 2m
BASEBALL = 9.125 * 0.0254 / np.pi
DRAG = 1.2 * 0.45 * np.pi * BASEBALL**2 / 4 / (2 * 5.125 * 0.028349523)


def test_a_kind_of_ball_gives_size_and_drag(folder: Path, tmp_path: Path) -> None:
    words = ["--calibration", str(folder / "cal.toml"), "--ball", "baseball", "--json"]
    at = ["track", str(folder / "clip.mp4"), "--out", str(tmp_path / "found")]
    done = CliRunner().invoke(cli, [*at, *words, "--plot", str(tmp_path / "plot.png")])
    assert done.exit_code == 0, done.output
    plot, stored = (cv2.imread(str(tmp_path / name)) for name in ("plot.png", "found/track.png"))
    assert (plot == stored).all()
    document = json.loads(done.stdout)
    assert document["scale"]["metres_per_pixel"] == pytest.approx(BASEBALL / 28, rel=5e-3)
    assert document["scale"]["relative_u"] == pytest.approx(4e-4 / BASEBALL, rel=0.25)
    assert document["drag_per_m"]["value"] == pytest.approx(DRAG, rel=1e-2)
    assert document["drag_per_m"]["u"] == pytest.approx(DRAG / 5, rel=1e-2)
    assert "was assumed" not in str(document["warnings"])


@pytest.mark.parametrize(
    ("ball", "said", "file", "drag"),
    [
        ("baseball", {}, "", DRAG),
        (vl.ball("baseball-2003").with_(mass="10.25 oz"), {}, "", DRAG / 2),
        ("baseball", {"mass": "72.646g"}, "", 2 * DRAG),
        ("baseball", {}, "drag_per_m = 0.003", 0.003),
        ("baseball", {"mass": "72.646g"}, "drag_per_m = 0.003", 2 * DRAG),
    ],
)
def test_stated_values_replace_those_of_the_kind_of_ball(
    ball: Any, said: dict[str, Any], file: str, drag: float, tmp_path: Path
) -> None:
    (tmp_path / "cal.toml").write_text(file)
    track = vl.track(FRAMES, ball=ball, fps=240, calibration=tmp_path / "cal.toml", **said)
    assert track.clip.knowledge.drag is not None
    assert track.clip.knowledge.drag[0] == pytest.approx(drag, rel=1e-4)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["clip.mp4"], "the scale is unknown"),
        (["clip.mp4", "--ball", "golf"], "e.g. '73mm±0.5mm', or the name or .toml"),
        (["clip.mp4", "--ball", "game"], "did you mean game-2003?"),
        (["clip.mp4", "--ball", "none.toml"], "none.toml"),
        (["clip.mp4", "--ball", "73"], "a length with its unit"),
        (["clip.mp4", "--ball", "73 furlongs"], "a length with its unit"),
        (["clip.mp4", "--ball", "0mm"], "0.001 to 1 m"),
        (["clip.mp4", "--ball", "28mm", "--calibration", "none.toml"], "none.toml"),
        (["cal.toml", "--ball", "28mm"], "cannot be opened"),
        (["none.mp4", "--ball", "28mm"], "no such file"),
        (["none.mp4"], "no such file"),
        (
            ["clip.mp4", "--ball", "28mm", "--calibration", "cal.toml", "--fps", "1e5"],
            "the frame interval",
        ),
    ],
)
def test_bad_input_leaves_nothing_behind(folder: Path, arguments: list[str], words: str) -> None:
    at = [str(folder / each) if "." in each and "mm" not in each else each for each in arguments]
    before = set(folder.iterdir())
    assert words in refusal_of("track", *at)
    assert set(folder.iterdir()) == before


def test_two_balls_are_flagged(folder: Path) -> None:
    """Two equal balls at the same time still give a result, with a flag."""
    other = replace(FILM, contact=(240.0, 30.0), noise=0.0, velocity_in=(9.3, -1.0))
    both = [np.maximum(a, b) for a, b in zip(FILM.frames(), other.frames(), strict=True)]
    np.save(folder / "two.npy", np.stack(both))
    arguments = ["--ball", "28mm", "--fps", "5000", "--json"]
    done = CliRunner().invoke(cli, ["track", str(folder / "two.npy"), *arguments])
    assert done.exit_code == 0, done.output
    assert "SECOND_BALL" in json.loads(done.stdout)["flags"]


@pytest.fixture(scope="module")
def thrown(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, dict[str, Any]]:
    """Return a phone's clip, the folder of its track, and the track's document."""
    at = tmp_path_factory.mktemp("thrown")
    scene = replace(SCENES["thrown-on-wall"], count=52, size=(320, 240))
    clip, out = film(scene, at).path, at / "found"
    words = ["--ball", "80mm±0.8mm", "--fps", "30", "--frames", "16:51", "--out", str(out)]
    done = CliRunner().invoke(cli, ["track", str(clip), *words, "--json"])
    assert done.exit_code == 0, done.output
    return clip, out, json.loads(done.stdout)


def test_a_phones_clip_gives_flights_contacts_and_flags(
    thrown: tuple[Path, Path, dict[str, Any]],
) -> None:
    """Flights, contacts and flags are complete, and the sheet has at most 4 megapixels."""
    _, out, document = thrown
    assert document["motion"] == "flights"
    assert [set(each) for each in document["contacts"]] == [
        {"time_s", "frame", "contact_kind", "restitution"}
    ]
    first = document["flights"][0]
    assert set(first) == {
        "flight", "first_frame", "last_frame", "positions",
        "speed_in_m_per_s", "speed_out_m_per_s", "angle_in_deg", "angle_out_deg",
        "acceleration_m_per_s2", "contact_kind", "contact_time_s", "restitution",
    }  # fmt: skip
    assert first["first_frame"] >= 16
    restitution = document["contacts"][0]["restitution"]
    assert abs(restitution["value"] - 0.77) < 2.5 * restitution["u"] < 0.1
    assert document["restitution"] == document["contacts"][0]["restitution"]
    assert "READOUT_UNKNOWN" in document["flags"]
    sheet = cv2.imread(str(out / "sheet.png"))
    assert sheet.shape[0] * sheet.shape[1] <= 4e6


def test_phone_omits_flags_that_hold_for_all_phones(
    thrown: tuple[Path, Path, dict[str, Any]],
) -> None:
    """With `phone`, no flag concerns readout, rate or the ball's u; results are the same."""
    clip, _, document = thrown
    tracked = vl.track(clip, ball="80mm", frames="16:51", phone=True)
    by_phone = tracked.document
    assert by_phone["flags"] == []
    assert all(each.startswith("the flights explain 9") for each in by_phone["warnings"])
    assert tracked.text.count("note: the flights explain 9") == len(by_phone["warnings"]) == 1
    assert "warning" not in tracked.text
    assert by_phone["contacts"] == document["contacts"]
    assert by_phone["frames_per_second"] == {"value": 30.0, "u": 0.0, "from": "given"}


def test_a_corrected_track_changes_the_result(thrown: tuple[Path, Path, dict[str, Any]]) -> None:
    """An unchanged table gives the same result; rows changed by hand change it."""
    clip, out, document = thrown
    rows = pd.read_csv(out / "track.csv")

    def again() -> dict[str, Any]:
        rows.to_csv(out.parent / "corrected.csv", index=False)
        words = {"ball": "80mm±0.8mm", "fps": 30, "global_shutter": True}
        return vl.track(clip, corrected=out.parent / "corrected.csv", **words).document

    same = again()
    value = document["contacts"][0]["restitution"]["value"]
    assert abs(same["contacts"][0]["restitution"]["value"] - value) < 2e-3
    assert "READOUT_UNKNOWN" not in same["flags"]
    rows.loc[rows["flight"] == 2, "y_px"] *= 1.1
    moved = again()
    assert moved["flights"][1]["acceleration_m_per_s2"]["value"] == pytest.approx(
        1.1 * same["flights"][1]["acceleration_m_per_s2"]["value"], rel=0.04
    )


def test_an_unchanged_track_gives_the_same_result(
    thrown: tuple[Path, Path, dict[str, Any]], tmp_path: Path
) -> None:
    """All numbers agree to the seven digits of the file; one moved position changes few."""
    clip, out, document = thrown
    rows = pd.read_csv(out / "track.csv")

    def again() -> dict[str, Any]:
        rows.to_csv(tmp_path / "corrected.csv", index=False)
        words = {"ball": "80mm±0.8mm", "fps": 30, "frames": "16:51"}
        return vl.track(clip, corrected=tmp_path / "corrected.csv", **words).document

    def scale_of(one: dict[str, Any]) -> tuple[str, float, float]:
        scale = one["scale"]
        return scale["from"], scale["metres_per_pixel"], scale["relative_u"]

    same = again()
    assert same["warnings"][0].startswith("positions by hand: none changed; before, fastest: ")
    assert same["flags"] == document["flags"]
    assert scale_of(same)[0] == scale_of(document)[0]
    assert scale_of(same)[1:] == pytest.approx(scale_of(document)[1:], rel=1e-4)
    for one, first in zip(same["flights"], document["flights"], strict=True):
        for name in ("speed_in_m_per_s", "speed_out_m_per_s", "acceleration_m_per_s2"):
            assert one[name] == pytest.approx(first[name], rel=1e-4)
    for one, first in zip(same["contacts"], document["contacts"], strict=True):
        assert one["restitution"] == pytest.approx(first["restitution"], rel=1e-4)
    moved_row = rows.index[len(rows) // 4]
    rows.loc[moved_row, "x_px"] += 2.0  # about a third of a radius
    moved = again()
    assert moved["flags"] == [*document["flags"], "POSITIONS_OFF"]
    frame = rows.loc[moved_row, "frame"]
    (words,) = (each for each in moved["warnings"] if "off the fitted" in each)
    assert words.startswith(f"positions: frame {frame} is 1.8 pix")
    _, scale, relative_u = scale_of(document)
    assert scale_of(moved)[1] == pytest.approx(scale, rel=relative_u)
    first, late = document["flights"][0]["speed_out_m_per_s"], moved["flights"][0]
    assert late["speed_out_m_per_s"]["value"] != pytest.approx(first["value"], rel=1e-4)
    assert abs(late["speed_out_m_per_s"]["value"] - first["value"]) < first["u"]
    assert moved["warnings"][0].startswith(f"positions by hand: frame {frame} is changed; before, ")


def test_the_sheet_enlarges_a_position_far_from_the_flight_with_coordinates(
    thrown: tuple[Path, Path, dict[str, Any]], tmp_path: Path
) -> None:
    """Lines at multiples of 20 px show the scale; the outline is at the stated position."""
    clip, out, _ = thrown
    rows = pd.read_csv(out / "track.csv")
    row = rows.index[len(rows) // 4]
    rows.loc[row, "x_px"] += 2.0
    rows.to_csv(tmp_path / "corrected.csv", index=False)
    words = {"ball": "80mm±0.8mm", "fps": 30, "frames": "16:51"}
    track = vl.track(clip, corrected=tmp_path / "corrected.csv", **words)
    sheet = cv2.imread(str(track.save(tmp_path / "again") / "sheet.png"))
    before = cv2.imread(str(out / "sheet.png"))
    part = sheet[len(before) :].astype(int)
    assert 300 < len(part) < 700
    # the lines are gray in the white margins, apart from the numbers below or to the right of them
    across = np.flatnonzero((part[-18, :] == 127).all(axis=-1))
    down = np.flatnonzero((part[:, 3] == 127).all(axis=-1))
    factor = np.diff(across)[0] / 20
    assert factor == int(factor) > 2
    blue = part[..., 0] - part[..., 2] > 50
    _, _, boxes, _ = cv2.connectedComponentsWithStats(blue.astype(np.uint8))
    left, top, wide, high, _ = boxes[1:][boxes[1:, 2].argmax()]
    place = rows.loc[row]
    assert wide / 2 / factor == pytest.approx(place["radius_px"], abs=0.5)
    for name, middle, lines in (("x", left + wide / 2, across), ("y", top + high / 2, down)):
        at = place[f"{name}_px"] + place[f"drift_{name}_px"]
        off = (middle - lines[0]) / factor - at
        assert abs((off + 10) % 20 - 10) < 0.6


def test_the_changes_of_a_correction_and_the_answer_before_are_stated(
    thrown: tuple[Path, Path, dict[str, Any]], tmp_path: Path
) -> None:
    """Two positions are moved, one is removed, another one is added."""
    clip, out, _ = thrown
    rows = pd.read_csv(out / "track.csv")
    rows.loc[[2, 4], "y_px"] += 1.5
    one, two, gone = rows["frame"][[2, 4, 6]]
    added = rows.iloc[-1].copy()
    added[["frame", "x_px"]] += [1, added["x_px"] - rows.iloc[-2]["x_px"]]
    rows = pd.concat([rows.drop(index=6), added.to_frame().T])
    rows.to_csv(tmp_path / "corrected.csv", index=False)
    words = {"ball": "80mm±0.8mm", "fps": 30, "frames": "16:51"}
    before = vl.track(clip, **words).text.partition("\n")[0]
    track = vl.track(clip, corrected=tmp_path / "corrected.csv", **words)
    changed = f"frames {one}, {two} are changed, frame {gone} is removed"
    said = f"positions by hand: {changed}, frame {added['frame']:.0f} is added; before, {before}"
    assert track.document["warnings"][0] == said
    assert f"\n  note: {said}\n" in track.text
    drag = track.document["drag_per_m"]
    assert drag["value"] < 2 * drag["u"]
    assert "the air takes" not in track.text  # because it is not significant


def test_the_track_of_another_clip_is_refused(
    thrown: tuple[Path, Path, dict[str, Any]], tmp_path: Path
) -> None:
    """The ball of the other clip flies one diameter farther to the left."""
    clip, out, _ = thrown
    rows = pd.read_csv(out / "track.csv")
    rows["x_px"] -= 2 * rows["radius_px"]
    rows.to_csv(tmp_path / "other.csv", index=False)
    with pytest.raises(InputError, match=r"^corrected; none of its .*: a track of this clip"):
        vl.track(clip, ball="80mm", fps=30, corrected=tmp_path / "other.csv")


def test_flights_at_the_same_time_are_refused(
    thrown: tuple[Path, Path, dict[str, Any]], tmp_path: Path
) -> None:
    """Alternate positions are assigned to two flights, as in a faulty correction."""
    clip, out, _ = thrown
    rows = pd.read_csv(out / "track.csv")
    rows["flight"] = np.resize(["a", "b"], len(rows))
    rows.to_csv(tmp_path / "mixed.csv", index=False)
    words = ["--ball", "80mm", "--fps", "30", "--corrected", str(tmp_path / "mixed.csv")]
    done = CliRunner().invoke(cli, ["track", str(clip), *words])
    assert isinstance(done.exception, InputError)
    assert "must begin after the previous one has ended" in str(done.exception)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--fps", "0"], "allowed: a number, 1 to 1e7"),
        (["--frames", "9:3"], "first:last"),
        (["--region", "1,2,3"], "x,y,width,height"),
        (["--region", "900,2,3,3"], "320 x 200"),
        (["--ball-at", "1,2"], "x,y@frame"),
        (["--ball-at", "1,2@999"], "last frame 29"),
        (["--scale", "1,2:3,4"], "x,y:x,y=length"),
        (["--scale", "1,2:3,4=1m"], "10 pixels apart or more"),
        (["--exposure", "8"], "a time with its unit"),
        (["--readout", "8ms", "--global-shutter"], "leave one out"),
        (["--readout", "8ms±2"], "'16ms' or '16ms±2ms'"),
        (["--readout", "8.4ms", "--fps", "240"], "the longest readout time 0.00833 s"),
        (["--gravity", "0"], "0.1 to 100"),
        (["--corrected", "none.csv"], "none.csv"),
        (["--ruler", "ball", "--scale", "10,20:200,20=19cm"], "the given length in the picture"),
    ],
)
def test_options_of_a_wrong_form_are_refused(folder: Path, words: list[str], message: str) -> None:
    assert message in refusal_of("track", str(folder / "clip.mp4"), "--ball", "28mm", *words)


def test_python_returns_tables(folder: Path) -> None:
    """Without a calibration file, tables are returned, too, and the text states the assumptions."""
    track = vl.track(folder / "clip.mp4", ball="2.8 cm", global_shutter=True)
    assert track.motion == "flights"
    assert len(track.flights) == 2
    speed = track.flights["speed_out_m_per_s"].iloc[0]
    true = np.hypot(*FILM.velocity_in) * 5.0
    assert abs(speed - true) < 3 * track.flights["speed_out_u_m_per_s"].iloc[0]
    assert list(track.contacts["contact_kind"]) == ["struck"]
    none = replace(track, clip=replace(track.clip, contacts=[], flights=[]))
    for name in ("contacts", "flights"):
        assert getattr(none, name).empty
        assert list(getattr(none, name)) == list(getattr(track, name))
    assert len(track.places) >= 28
    assert "flights" in repr(track)
    assert "the frame rate is the file's own" in track.text
    assert "0.28 mm was assumed" in track.text


@pytest.mark.parametrize(
    ("clip", "said", "message"),
    [
        (FRAMES, {"fps": "x"}, "fps = 'x'; allowed: a number, 1 to 1e7 frames per second"),
        (FRAMES, {"fps": True}, "fps = True"),
        (FRAMES, {"ball": 0.073}, "ball = 0.073; allowed: a diameter with its unit"),
        (FRAMES, {"exposure": 0.002}, "e.g. '8ms' or '1/120'"),
        (FRAMES, {"foo": 1}, "foo; unknown argument, allowed: clip, ball, mass, fps"),
        (FRAMES, {"tripot": True}, "tripot; unknown argument, did you mean tripod"),
        (FRAMES, {"tripod": "yes"}, "tripod = 'yes'; allowed: True or False"),
        (FRAMES, {"calibration": 4}, "calibration = 4"),
        (FRAMES, {"ball": "73mm", "ruler": "moon"}, "ruler = 'moon'; allowed: gravity or ball"),
        (FRAMES, {"ruler": "ball", "fps": 9}, "the scale is unknown"),
        (FRAMES, {"ball": "73mm"}, "give fps="),
        (FRAMES, {"mass": "145", "fps": 9}, "mass = '145'; allowed: a mass with its unit"),
        (
            FRAMES,
            {"mass": "145stone", "fps": 9},
            "mass = '145stone'; allowed: a mass with its unit",
        ),
        (
            FRAMES,
            {"mass": "145g", "ruler": "gravity", "fps": 9},
            "mass = '145g'; the drag depends",
        ),
        (FRAMES / 255, {"ball": "73mm", "fps": 240}, "expected 8 or 16 bits"),
        (FRAMES[0], {"ball": "73mm", "fps": 240}, "expected (frame, row, column)"),
        (list(FRAMES), {"ball": "73mm", "fps": 240}, "a numpy array (frame, row, column)"),
        (None, {"ball": "73mm"}, "clip = None; allowed: a path"),
    ],
)
def test_wrong_types_in_python_name_the_allowed_ones(
    clip: Any, said: dict[str, Any], message: str
) -> None:
    with pytest.raises(InputError) as refused:
        vl.track(clip, **said)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("said", "times"),
    [({"readout": "66ms±2ms"}, (0.066, 0.002)), ({"readout": "1/50"}, (0.02, 0.0)),
     ({"global_shutter": True}, (0.0, 0.0))],
)  # fmt: skip
def test_a_readout_time_may_have_a_u(said: dict[str, Any], times: tuple[float, float]) -> None:
    knowledge = vl.track(FRAMES, ball="28mm", fps=30, **said).clip.knowledge
    assert (knowledge.readout, knowledge.readout_u) == pytest.approx(times)


def test_a_clip_without_a_ball_is_a_sentence() -> None:
    track = vl.track(FRAMES, ball="28mm", fps=240)
    sentence, note = track.text.splitlines()[:2]
    assert sentence == "no ball in flight was found in the 3 frames of array"
    assert "point at the ball with ball_at=" in note
    assert (track.motion, len(track.flights)) == ("none", 0)


def test_an_array_of_frames_is_followed_as_its_file_is(folder: Path) -> None:
    frames = np.stack(list(FILM.frames()))
    np.save(folder / "same.npy", frames)
    said = {"ball": "28mm±0.1mm", "fps": np.int64(5000), "global_shutter": True}
    one, other = (vl.track(each, **said).document for each in (frames, folder / "same.npy"))
    assert one["clip"] == "array"
    assert one | {"clip": ""} == other | {"clip": ""}
