"""Sessions on disk are read back bit for bit; each broken folder gives one line."""

import hashlib
import json
import os
from collections.abc import Callable
from dataclasses import replace
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.records.digests import channel_digest
from tests.records.test_records import ANY, bits
from virtual_lab.errors import InputError
from virtual_lab.measurement.certification import certify_session
from virtual_lab.records import ClipRecord, GateRecord, MassReadings, Record, ShotLog, join
from virtual_lab.records.constants import constant_of
from virtual_lab.records.origin import ModelUsed, Simulated, Supplied
from virtual_lab.records.session import Session, load_session, save_session
from virtual_lab.uncertainty.estimate import Estimate

# names without a known range of values; hypothesis also draws strings of the program's own source
NAMES = st.text(min_size=1).filter(lambda name: constant_of(name) is None)
ESTIMATES = st.builds(
    Estimate,
    value=st.floats(-1e18, 1e18),
    u=st.floats(0, 1e18),
    dof=st.just(inf) | st.floats(1e-3, 1e6),
)
FLIGHTS = np.arange(16.0).reshape(2, 2, 2, 2)  # two balls, in and back
FLIGHTS[:, 1] = FLIGHTS[:, 1, ::-1]
EXAMPLE = Session(
    bat="r161",
    ball="baseball-2003",
    date="2026-11-20",
    bat_sport="softball",
    ball_sport="baseball",
    bat_construction="composite wood",
    rigs={"impact": "astm-pivot"},
    procedure_text='name = "übung"\n',
    calibration={"impact.gates.clock": Estimate(value=1.0, u=2e-5, dof=7.0, source="x")},
    records={
        "impact": {
            "log": ShotLog(ball=np.arange(2.0), nominal_speed=np.ones(2), place=np.ones(2)),
            "gates": GateRecord(times=FLIGHTS),
        },
        "bench": {"bat-mass": MassReadings(readings=np.ones((1, 3)))},
    },
    origin=Simulated(
        reality="real",
        sealing="sealed",
        seed_commitment="ab",
        unverified_numbers={"bats/r161": "1 of 2"},
        rungs={"collision": ModelUsed(rung="modal", reason="was asked for", error=1e-5)},
    ),
)
SUPPLIED = replace(EXAMPLE, origin=Supplied(laboratory="Übungslabor", customer="Ashwood & Sons"))


@given(record=ANY, known=st.dictionaries(NAMES, ESTIMATES, max_size=3))
@settings(max_examples=60)
def test_every_record_comes_back_bit_for_bit(record: Record, known: dict) -> None:
    """Arbitrary doubles of each record type through CSV, and calibrations through JSON."""
    with TemporaryDirectory() as folder:
        session = replace(EXAMPLE, records={"impact": {"x": record}}, calibration=known)
        save_session(session, Path(folder))
        loaded = load_session(Path(folder))
    assert type(loaded.records["impact"]["x"]) is type(record)
    assert bits(loaded.records["impact"]["x"]) == bits(record)
    assert {k: (e.value, e.u, e.dof) for k, e in loaded.calibration.items()} == {
        k: (e.value, e.u, e.dof) for k, e in known.items()
    }


@pytest.mark.parametrize("example", [EXAMPLE, SUPPLIED])
def test_names_rules_and_origin_survive_a_folder(example: Session, tmp_path: Path) -> None:
    """Names, rigs, the exact text of the procedure, and the origin of the records."""
    save_session(example, tmp_path)
    loaded = load_session(tmp_path)
    named = ("bat", "ball", "bat_sport", "bat_construction", "ball_sport", "date", "rigs")
    for field in (*named, "procedure_text", "calibration", "origin"):
        assert getattr(loaded, field) == getattr(example, field)
    assert {stage: set(found) for stage, found in loaded.records.items()} == {
        "impact": {"log", "gates"},
        "bench": {"bat-mass"},
    }


def _edit(change: Callable[[dict], object]) -> Callable[[Path], object]:
    def edit(folder: Path) -> None:
        path = folder / "session.json"
        document = json.loads(path.read_text("utf-8"))
        change(document)
        path.write_text(json.dumps(document), "utf-8")

    return edit


def _file(name: str, old: str, new: str) -> Callable[[Path], object]:
    """Return a change of a record file that also corrects its digest in session.json."""

    def change(folder: Path) -> None:
        path = folder / name
        text = path.read_text("utf-8")
        assert old in text
        path.write_text(text.replace(old, new, 1), "utf-8")
        _edit(lambda d: d["channels"]["impact"]["gates"].update(sha256=channel_digest(d, path)))(
            folder
        )

    return change


def _rules(folder: Path) -> None:
    path = folder / "procedure.toml"
    path.write_text(path.read_text("utf-8") + "# a limit\n", "utf-8")


def _linked(name: str) -> Callable[[Path], object]:
    """Replace a file or a folder by a link to a copy elsewhere."""

    def change(folder: Path) -> None:
        elsewhere = (folder / name).rename(folder.with_name("elsewhere"))
        (folder / name).symlink_to(elsewhere)

    return change


def _cut(folder: Path) -> None:
    path = folder / "impact/gates.csv"
    path.write_text("".join(path.read_text("utf-8").splitlines(keepends=True)[:-3]), "utf-8")


GATES = "impact/gates.csv"


@pytest.mark.parametrize(
    ("break_it", "file", "key", "allowed"),
    [
        (_cut, "gates.csv", "rows", "session.json says 16"),
        (lambda f: (f / GATES).unlink(), "gates.csv", "file", "cannot be read"),
        (lambda f: (f / "session.json").unlink(), "session.json", "file", "cannot be read"),
        (lambda f: (f / "procedure.toml").unlink(), "procedure.toml", "file", "cannot be read"),
        (lambda f: (f / "session.json").write_text("{"), "session.json", "JSON", "parsed"),
        (lambda f: (f / "session.json").write_text("[]"), "session.json", "JSON", "object"),
        (_rules, "procedure.toml", "sha256", "was changed after"),
        (_edit(lambda d: d.pop("procedure_sha256")), "session.json", "procedure_sha256", "missing"),
        (
            _edit(lambda d: d["channels"]["impact"]["gates"].pop("sha256")),
            "session.json",
            "impact.gates.sha256",
            "missing",
        ),
        (
            _edit(lambda d: d["channels"]["impact"]["gates"].pop("rows")),
            "session.json",
            "impact.gates.rows",
            "missing",
        ),
        (_linked("procedure.toml"), "procedure.toml", "file", "ordinary files"),
        (_linked("session.json"), "session.json", "file", "ordinary files"),
        (_linked(GATES), "gates.csv", "file", "ordinary files"),
        (_linked("impact"), "impact", "file", "ordinary files"),
        (lambda f: (f / "notes.txt").write_text(""), "notes.txt", "file", "is not listed in"),
        (lambda f: (f / "impact/x.csv").write_text(""), "x.csv", "file", "is not listed in"),
        (lambda f: os.mkfifo(f / "impact/pipe"), "pipe", "file", "ordinary files"),
        (
            lambda f: ((f / GATES).unlink(), os.mkfifo(f / GATES)),
            "gates.csv",
            "file",
            "ordinary files",
        ),
        (_edit(lambda d: d.pop("origin")), "session.json", "origin", "missing"),
        (_edit(lambda d: d.update(origin="ours")), "session.json", "origin", "'simulated'"),
        (_edit(lambda d: d.pop("simulation")), "session.json", "simulation", "'simulated'"),
        (_edit(lambda d: d.update(simulation={})), "session.json", "simulation", "missing"),
        (
            _edit(lambda d: d["simulation"].pop("sealing")),
            "session.json",
            "simulation.sealing",
            "missing",
        ),
        (
            _edit(lambda d: d["simulation"]["rungs"]["collision"].update(error="1e-5")),
            "session.json",
            "rungs.collision.error",
            "number",
        ),
        (
            _edit(lambda d: d.update(simulation={}, laboratory="National Bat Laboratory")),
            "session.json",
            "simulation",
            "missing",
        ),
        (
            _edit(lambda d: d.update(laboratory="National Bat Laboratory")),
            "session.json",
            "laboratory",
            "not allowed: the origin of these records is 'simulated'",
        ),
        (
            _edit(lambda d: d.update(origin="supplied", laboratory="National Bat Laboratory")),
            "session.json",
            "simulation",
            "not allowed: the origin of these records is 'supplied'",
        ),
        (
            _edit(lambda d: (d.update(origin="supplied"), d.pop("simulation"))),
            "session.json",
            "laboratory",
            "missing",
        ),
        (_file(GATES, "time_s", "time_ms"), "gates.csv", "columns", "time_s"),
        (_file(GATES, "1,1,0,1,15.0", "1,1,0,1,soon"), "gates.csv", "time_s", "numbers"),
        (_file(GATES, "1,1,0,1,15.0", "1,1,0,0,15.0"), "gates.csv", "rows", "same"),
        (_file(GATES, "1,1,0,1,15.0", "1,1,0,1,13.5"), "gates.csv", "time_s", "clears before"),
        (_file(GATES, "1,1,0,1,15.0", "1,1,0,1,15.0,9"), "gates.csv", "line", "decimal commas"),
        (
            lambda f: (f / GATES).write_text((f / GATES).read_text().replace("15.0", "15.5")),
            "gates.csv",
            "sha256",
            "was changed after",
        ),
        (lambda f: (f / GATES).write_bytes(b""), "gates.csv", "CSV", "cannot be read"),
        (lambda f: (f / GATES).write_bytes(b"\xff\xfe"), "gates.csv", "CSV", "cannot be read"),
        (_edit(lambda d: d.update(schema=99)), "session.json", "schema", "must be 2"),
        (_edit(lambda d: d.pop("schema")), "session.json", "schema", "missing"),
        (_edit(lambda d: d.pop("calibration")), "session.json", "calibration", "missing"),
        (_edit(lambda d: d.update(channels=[])), "session.json", "channels", ""),
        (
            _edit(lambda d: d["channels"]["impact"]["gates"].update(record="radar")),
            "session.json",
            "gates.record",
            "allowed: mass-readings",
        ),
        (
            _edit(lambda d: d["channels"]["impact"].update(gates=3)),
            "session.json",
            "gates",
            "",
        ),
        (
            _edit(lambda d: d["calibration"].update({"a.b": {"value": "one", "u": 0}})),
            "session.json",
            "calibration.a.b",
            "",
        ),
        (
            _edit(lambda d: d["calibration"].update({"a.b": {"value": 1.0}})),
            "session.json",
            "calibration.a.b.u",
            "missing",
        ),
        (
            _edit(lambda d: d["calibration"].update({"a.b": {"value": 1.0, "u": -1.0}})),
            "session.json",
            "calibration.a.b",
            "at least 0",
        ),
    ],
)
def test_every_fault_of_a_session_folder_is_named(
    break_it: Callable[[Path], object], file: str, key: str, allowed: str, tmp_path: Path
) -> None:
    """One fault at a time in a valid folder: one line names file, key and remedy."""
    folder = tmp_path / "records"
    folder.mkdir()
    save_session(EXAMPLE, folder)
    load_session(folder)
    break_it(folder)
    with pytest.raises(InputError) as caught:
        load_session(folder)
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert file in caught.value.where
    assert key in caught.value.key
    assert allowed in caught.value.allowed


def test_a_session_written_by_hand_from_the_manual_is_read(tmp_path: Path) -> None:
    """Written without this package: keys of docs/raw-records.md, plain text, digests by hashlib."""
    (tmp_path / "bench").mkdir()
    (tmp_path / "bench" / "bat-mass.csv").write_text("item,repeat,mass_kg\n0,0,0.91\n0,1,0.92\n")
    (tmp_path / "procedure.toml").write_text('name = "ours"\n')
    mass, rules = (
        hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()
        for name in ("bench/bat-mass.csv", "procedure.toml")
    )
    document = {
        "schema": 2,
        "origin": "supplied",
        "laboratory": "Crosstown Bat Laboratory",
        "bat": "r161",
        "ball": "baseball-2003",
        "rigs": {"bench": "a table"},
        "procedure_sha256": rules,
        "channels": {"bench": {"bat-mass": {"record": "mass-readings", "rows": 2, "sha256": mass}}},
        "calibration": {"bench.scale.zero": {"value": 0.0, "u": 5e-5}},
    }
    (tmp_path / "session.json").write_text(json.dumps(document))
    session = load_session(tmp_path)
    assert session.origin == Supplied(laboratory="Crosstown Bat Laboratory")
    assert session.records["bench"]["bat-mass"].readings.tolist() == [[0.91, 0.92]]


def test_a_missing_edge_is_an_empty_cell(tmp_path: Path) -> None:
    """NaN means not detected; another laboratory's file leaves the cell empty."""
    save_session(EXAMPLE, tmp_path)
    _file(GATES, "1,1,0,1,15.0", "1,1,0,1,")(tmp_path)
    times = load_session(tmp_path).records["impact"]["gates"].times
    assert np.isnan(times[1, 1, 0, 1])
    assert np.isfinite(times).sum() == 15


def _without(stage: str, channel: str) -> Callable[[Session], Session]:
    def change(session: Session) -> Session:
        records = {name: dict(found) for name, found in session.records.items()}
        del records[stage][channel]
        return replace(session, records=records)

    return change


def _without_stage(session: Session) -> Session:
    return replace(session, records={k: v for k, v in session.records.items() if k != "balls"})


def _without_constant(session: Session) -> Session:
    known = {k: v for k, v in session.calibration.items() if k != "impact.encoder.scale"}
    return replace(session, calibration=known)


def _ball(number: float) -> Callable[[Session], Session]:
    def change(session: Session) -> Session:
        log = session.records["impact"]["log"]
        ball = np.array(log.ball)
        ball[0] = number
        impact = dict(session.records["impact"]) | {"log": replace(log, ball=ball)}
        return replace(session, records=dict(session.records) | {"impact": impact})

    return change


def _wrong_kind(session: Session) -> Session:
    bench = dict(session.records["bench"])
    bench["pendulum"] = bench["length"]
    return replace(session, records=dict(session.records) | {"bench": bench})


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (_without("impact", "encoder"), "encoder"),
        (_without("impact", "aim"), "aim"),
        (_without("bench", "bat-mass"), "bat-mass"),
        (_without("balls", "log"), "log"),
        (_without_stage, "balls"),
        (_without_constant, "impact.encoder.scale"),
        (_ball(-1.0), "ball"),
        (_ball(999.0), "ball"),
        (_ball(0.5), "ball"),
        (_wrong_kind, "pendulum"),
    ],
)
def test_a_missing_or_impossible_entry_of_a_session_is_named(change, named: str, played) -> None:
    """A session with one missing or impossible entry gives one line that names it."""
    session = played().certification.session
    with pytest.raises(InputError) as caught:
        certify_session(change(session))
    assert "\n" not in str(caught.value)
    assert named in str(caught.value)


CLIP = ClipRecord(
    times=np.array([[0.1, 0.2, np.nan], [0.3, 0.4, 0.5]]),
    left=np.array([[4.0, 5.0, np.nan], [6.0, 7.0, 8.0]]),
    top=np.zeros((2, 3)),
    pixels=np.arange(2 * 3 * 4 * 4, dtype=np.uint16).reshape(2, 3, 4, 4),
    background=np.linspace(0, 1, 60, dtype=np.float32).reshape(6, 10),
)
FILMED = replace(EXAMPLE, records={"impact": {"clip": CLIP}})
PIXELS, BACKGROUND = "impact/clip-pixels.npy", "impact/clip-background.npy"


def test_arrays_beside_a_table_come_back_bit_for_bit(tmp_path: Path) -> None:
    """Gray values of 16 bits and floats are memory-mapped; a record without arrays works, too."""
    save_session(FILMED, tmp_path)
    clip = load_session(tmp_path).records["impact"]["clip"]
    assert isinstance(clip, ClipRecord)
    assert bits(clip) == bits(CLIP)
    for name in ("pixels", "background"):
        loaded, own = getattr(clip, name), getattr(CLIP, name)
        assert isinstance(loaded, np.memmap)
        assert loaded.dtype == own.dtype
        assert np.array_equal(loaded, own)
    (tmp_path / "again").mkdir()
    bare = replace(CLIP, pixels=None)
    save_session(replace(FILMED, records={"impact": {"clip": bare}}), tmp_path / "again")
    assert not (tmp_path / "again" / PIXELS).exists()
    clip = load_session(tmp_path / "again").records["impact"]["clip"]
    assert isinstance(clip, ClipRecord)
    assert clip.pixels is None
    assert np.array_equal(clip.background, CLIP.background)


def test_rounds_with_pixels_are_joined_shot_after_shot() -> None:
    both = join([CLIP, replace(CLIP, pixels=CLIP.pixels + 1)])
    assert isinstance(both, ClipRecord)
    assert np.array_equal(both.pixels[:2], CLIP.pixels)
    assert np.array_equal(both.pixels[2:], CLIP.pixels + 1)
    assert np.array_equal(both.background, CLIP.background)


def _array(name: str, values: np.ndarray) -> Callable[[Path], object]:
    """Return a change of an array beside a table that also corrects its digest in session.json."""

    def change(folder: Path) -> None:
        np.save(folder / name, values)
        key = Path(name).stem.removeprefix("clip-")

        def told(document: dict[str, Any]) -> None:
            digest = channel_digest(document, folder / name)
            document["channels"]["impact"]["clip"]["attached"][key] = digest

        _edit(told)(folder)

    return change


def _shorter(folder: Path) -> None:
    data = (folder / PIXELS).read_bytes()
    (folder / PIXELS).write_bytes(data[:-16])


@pytest.mark.parametrize(
    ("break_it", "file", "key", "allowed"),
    [
        (lambda f: (f / PIXELS).unlink(), "clip-pixels.npy", "file", "cannot be read"),
        (lambda f: (f / BACKGROUND).unlink(), "clip-background.npy", "file", "cannot be read"),
        (_shorter, "clip-pixels.npy", "file", "cannot be read"),
        (lambda f: (f / PIXELS).write_bytes(b"pixels"), "clip-pixels.npy", "file", "cannot be"),
        (
            lambda f: np.save(f / PIXELS, CLIP.pixels + 1),
            "clip-pixels.npy",
            "sha256",
            "was changed after",
        ),
        (_array(PIXELS, CLIP.pixels[:, :2]), "clip-pixels.npy", "shape", "2 along 'frame'"),
        (_array(PIXELS, CLIP.pixels[:1]), "clip-pixels.npy", "shape", "1 along 'shot'"),
        (_array(PIXELS, CLIP.pixels[0]), "clip-pixels.npy", "shape", "needs the axes"),
        (_array(BACKGROUND, CLIP.pixels), "clip-background.npy", "shape", "needs the axes"),
        (_array(BACKGROUND, np.full((6, 10), "x")), "clip-background.npy", "shape", "real numbers"),
        (
            _edit(lambda d: d["channels"]["impact"]["clip"]["attached"].update(film="ab")),
            "clip.csv",
            "attached",
            "allowed: pixels, background",
        ),
        (
            _edit(lambda d: d["channels"]["impact"]["clip"].update(attached=["pixels"])),
            "session.json",
            "clip.attached",
            "must be a table",
        ),
    ],
)
def test_every_fault_of_stored_arrays_is_named(
    break_it: Callable[[Path], object], file: str, key: str, allowed: str, tmp_path: Path
) -> None:
    """One fault at a time: the message names the array's file, or the table it belongs to."""
    save_session(FILMED, tmp_path)
    load_session(tmp_path)
    break_it(tmp_path)
    with pytest.raises(InputError) as caught:
        load_session(tmp_path)
    assert "\n" not in str(caught.value)
    assert caught.value.where.endswith(file)
    assert key in caught.value.key
    assert allowed in caught.value.allowed
