"""Careless and hostile input gives one line that names the remedy, and writes nothing.

A case has a function that fills the folder, the command, and words that the line must contain:
which file, which key, which values are allowed.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import resource
import shutil
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.cli.test_cli import MEASURED, R161, ROOT, Run, run  # noqa: F401 its fixture
from tests.records.digests import channel_digest
from virtual_lab.records.session import save_session
from virtual_lab.studies.foreign import our_session

Setup = Callable[[Path, Path], object]  # folder to fill, valid session to copy
Case = tuple[Setup, str, list[str]]

FORM = ROOT / "tests" / "foreign_laboratory" / "records"
RULES = (ROOT / "data" / "procedures" / "astm-f1881.toml").read_text()
BALL = (ROOT / "data" / "balls" / "game-2003.toml").read_text()
LONG = "x" * 300
BOARD = "--board charuco:9x6:60mm:44mm"
TRACK = "track clip.npy --ball 28mm --calibration"
CAMERA = """
[camera]
image_size = [32, 20]
matrix = [[100.0, 0.0, 16.0], [0.0, 100.0, 10.0], [0.0, 0.0, 1.0]]
distortion = [0.0, 0.0, 0.0, 0.0]
rotation = [0.0, 0.0, 0.0]
translation_m = [0.0, 0.0, 1.0]
"""


def nothing(at: Path, records: Path) -> None:
    """Leave the folder empty."""


def file(name: str, data: str | bytes) -> Setup:
    """Write one file."""
    return lambda at, _: (at / name).write_bytes(data if isinstance(data, bytes) else data.encode())


def changed(name: str, text: str, *changes: tuple[str, str]) -> Setup:
    """Write a file with changes by regular expression, each made once; it is valid without them."""
    for old, new in changes:
        text, count = re.subn(old, lambda _, new=new: new, text, count=1)
        assert count == 1, old
    return file(name, text)


def bat(*changes: tuple[str, str]) -> Setup:
    return changed("mine.toml", R161, *changes)


def added(to: str, table: str, **numbers: str) -> Setup:
    """Write a bat with one more table; numbers as ``value unit``."""
    lines = [f"[{table}]"]
    for key, number in numbers.items():
        value, unit = number.split(maxsplit=1)
        entry = f'value = {value}, unit = "{unit}", source = "x", verified = false'
        lines.append(f"{key} = {{ {entry} }}" if unit != "-" else f"{key} = {value}")
    return file("mine.toml", to + "\n".join(["", *lines, ""]))


def session(change: Callable[[dict], object] | str | bytes) -> Setup:
    """Copy a valid session, and change or replace its session.json."""

    def setup(at: Path, records: Path) -> None:
        shutil.copytree(records, at / "r")
        path = at / "r" / "session.json"
        if callable(change):
            document = json.loads(path.read_text())
            change(document)
            path.write_text(json.dumps(document))
        else:
            path.write_bytes(change if isinstance(change, bytes) else change.encode())

    return setup


def constant(key: str, **entry: object) -> Setup:
    return session(lambda document: document["calibration"][key].update(entry))


def renamed(name: str) -> Setup:
    """Rename a channel of a valid session."""

    def change(document: dict) -> None:
        channels = document["channels"]["impact"]
        channels[name] = channels.pop("gates")

    return session(change)


def record(name: str, change: Callable[[str], str | bytes]) -> Setup:
    """Copy a valid session, and change a record with its digest in session.json."""

    def setup(at: Path, records: Path) -> None:
        stage, channel = name.split("/")
        data = change((records / f"{name}.csv").read_text())
        data = data if isinstance(data, bytes) else data.encode()

        def renew(document: dict) -> None:
            path = at / "r" / f"{name}.csv"
            path.write_bytes(data)
            document["channels"][stage][channel]["sha256"] = channel_digest(document, path)

        session(renew)(at, records)

    return setup


def piped(name: str) -> Setup:
    """Copy a valid session in which one file is a pipe without a writer."""

    def setup(at: Path, records: Path) -> None:
        session(lambda _: None)(at, records)
        (at / "r" / name).unlink(missing_ok=True)
        os.mkfifo(at / "r" / name)

    return setup


def linked(name: str, to: str) -> Setup:
    """Copy a valid session in which one file is a link to a copy outside."""

    def setup(at: Path, records: Path) -> None:
        session(lambda _: None)(at, records)
        path = at / "r" / name
        shutil.copy(path, at / "outside")
        path.unlink()
        path.symlink_to(to)

    return setup


def form(*changes: tuple[str, str]) -> Setup:
    """Copy another laboratory's folder, and change its form."""

    def setup(at: Path, records: Path) -> None:
        shutil.copytree(FORM, at / "r")
        changed("r/laboratory.toml", (FORM / "laboratory.toml").read_text(), *changes)(at, records)

    return setup


def clip(calibration: str, frames: object = None, **files: str) -> Setup:
    """Write a clip without a ball (or raw bytes), its calibration and files beside it."""

    def setup(at: Path, records: Path) -> None:
        if isinstance(frames, bytes):
            (at / "clip.npy").write_bytes(frames)
        else:
            np.save(at / "clip.npy", np.zeros((9, 20, 32), np.uint8) if frames is None else frames)
        (at / "cal.toml").write_text(calibration)
        for name, text in files.items():
            (at / f"{name}.csv").write_text(text)

    return setup


def pictures(at: Path, records: Path) -> None:
    for number in range(3):
        cv2.imwrite(str(at / f"{number}.png"), np.full((60, 80), 90, np.uint8))


def _last_cell(cell: str) -> Callable[[str], str]:
    return lambda text: text.rstrip().rpartition(",")[0] + f",{cell}\n"


FPS = "frames_per_second = 1000\n"
GATES, ENCODER = "impact/gates", "impact/encoder"
TESTED = "certify r161 --procedure mine.toml"
CASES: dict[str, Case] = {
    # names, paths and options
    "a folder's name of 300": (
        nothing,
        f"certify r161 --out {LONG}",
        ["output folder", "too long"],
    ),
    "a path of 3000 folders": (nothing, f"profile r161 --out {'d/' * 3000}x", ["too long"]),
    "a folder that links to itself": (
        lambda at, _: (at / "loop").symlink_to("loop"),
        "profile r161 --out loop",
        ["loop", "is a link to a missing file"],
    ),
    "a folder within such a link": (
        lambda at, _: (at / "loop").symlink_to("loop"),
        "profile r161 --out loop/x",
        ["loop/x", "cannot be written"],
    ),
    "the folder one is in": (nothing, "profile r161 --out .", ["is the current folder"]),
    "a folder that takes no file": (
        nothing,
        "profile r161 --out /proc/x",
        ["/proc cannot be written to"],
    ),
    "a device as a folder": (nothing, "profile r161 --out /dev/null", ["/dev/null", "is a file"]),
    "a bat's name of 300": (nothing, f"certify {LONG}", ["bat = 'xxx", "allowed: "]),
    "a bat's file of 300": (nothing, f"certify {LONG}.toml", ["bat file", "no such file"]),
    "an empty name": (nothing, "certify ''", ["bat = ''", "allowed: "]),
    "a name and a line break": (nothing, "certify 'r161\n'", ["did you mean r161?"]),
    "a slash at the end": (bat(), "certify mine.toml/", ["bat = 'mine.toml/'", "allowed: "]),
    "a name that climbs": (nothing, "certify ../bats/r161", ["bat = '../bats/r161'"]),
    "a home in a path": (nothing, "certify ~nobody/mine.toml", ["no such file"]),
    "a folder for a bat": (
        lambda at, _: (at / "mine.toml").mkdir(),
        "certify mine.toml",
        ["no such file"],
    ),
    "a procedure for a bat": (nothing, "certify astm-f1881", ["among the procedures"]),
    "a bat for a procedure": (nothing, "certify r161 --procedure r161", ["among the bats"]),
    "a rig's name mistyped": (
        nothing,
        "certify r161 --rig astm-pivto",
        ["did you mean astm-pivot?"],
    ),
    "an option mistyped": (nothing, "certify r161 --procedur x", ["'--procedure'"]),
    "a command mistyped": (nothing, "certfy r161", ["'certify'"]),
    "a seed with a comma": (nothing, "certify r161 --seed 1,5", ["--seed", "'1,5'"]),
    "an empty ball": (nothing, "profile r161 --ball ''", ["ball = ''"]),
    "an exponent that is none": (nothing, "profile r161 --swing nan", ["0 to 0.5"]),
    "mornings without end": (nothing, "daily --days 1000000000", ["days", "6 to 10000"]),
    "a fault nobody plays": (
        nothing,
        "faults gate-moved --procedure asa",
        ["predictions for astm-f1881, bbcor"],
    ),
    "a procedure no fault is played by": (
        nothing,
        "faults gate-moved --procedure bbcor --procedure asa",
        ["procedure = 'asa'", "astm-f1881, bbcor"],
    ),
    "a result for its records": (
        lambda at, records: shutil.copytree(records, at / "r161" / "records"),
        "reduce r161",
        ["the records are in r161/records"],
    ),
    "a file for its records": (
        file("r.json", "{}"),
        "reduce r.json",
        ["r.json", "holds no session.json"],
    ),
    "records for a result": (
        session(lambda _: None),
        "score r",
        ["r: folder; is", "result folder (certificate.json)"],
    ),
    "a board of 400 m": (nothing, "board --board chessboard:14x9:40m --out b", ["0.001 to 1 m"]),
    "a board of 1000 squares": (
        nothing,
        "board --board chessboard:999x999:40mm --out b",
        ["longer than 10 m"],
    ),
    "a camera that is a bat": (nothing, f"board {BOARD} --camera r161 --out b", ["among the bats"]),
    "a ball of 9 m": (clip(FPS), "track clip.npy --ball 9m", ["--ball = '9m'", "0.001 to 1 m"]),
    "a ball in a comma": (clip(FPS), "track clip.npy --ball 7,3cm", ["a length with its unit"]),
    "squares as unsure as long": (
        pictures,
        f"calibrate 0.png {BOARD} --square-u 50mm --out c.toml",
        ["--square-u"],
    ),
    "pictures without a board": (
        pictures,
        f"calibrate 0.png 1.png 2.png {BOARD} --out c.toml",
        ["must show the board"],
    ),
    "a picture's name of 300": (nothing, f"calibrate {LONG} {BOARD} --out c.toml", ["too long"]),
    "a clip that never ends": (nothing, "track /dev/zero --ball 28mm", ["no such file or folder"]),
    "a clip of no name": (nothing, "track '' --ball 28mm", ["images = 0"]),
    # file of a bat
    "200 000 brackets": (
        file("mine.toml", "a = " + "[" * 200_000),
        "profile mine.toml",
        ["nested"],
    ),
    "a key of 50 000 dots": (
        file("mine.toml", "a" + ".a" * 50_000 + " = 1\n" + R161),
        "profile mine.toml",
        ["nested"],
    ),
    "a table of 50 000 dots": (
        file("mine.toml", R161 + "\n[a" + '."a"' * 50_000 + "]\n"),
        "profile mine.toml",
        ["nested"],
    ),
    "meters for inches": (
        file("mine.toml", R161.replace('"in"', '"m"')),
        "profile mine.toml",
        ["mine.toml", "body.profile.z", "0 to 1.5 m", "'in'"],
    ),
    "millimeters for inches": (
        file("mine.toml", R161.replace('"in"', '"mm"')),
        "profile mine.toml",
        ["is the unit right?"],
    ),
    "pounds for ounces": (
        changed("ball.toml", BALL, ('mass = (.*?)"oz"', 'mass = { value = 5.1, unit = "lb"')),
        "profile r161 --ball ball.toml",
        ["ball.toml", "mass", "is the unit 'oz'?"],
    ),
    "a spread of 500 %": (
        bat((r"density = \{ value = 1.0", "density = { value = 500")),
        "certify mine.toml",
        ["spread.density = '500 %'", "0 to 20 %"],
    ),
    "a key mistyped": (
        bat(("damping_ratio", "damping_ration")),
        "profile mine.toml",
        ["unknown key, did you mean damping_ratio?"],
    ),
    "a table mistyped": (bat((r"\[spread\]", "[spred]")), "profile mine.toml", ["mean spread?"]),
    "a unit mistyped": (bat(('"in"', '"inch"')), "profile mine.toml", ["did you mean in?"]),
    "a unit in capitals": (bat(('"GPa"', '"GPA"')), "profile mine.toml", ["did you mean GPa"]),
    "a number as a text": (bat(("644.3", '"644.3"')), "profile mine.toml", ["density", "number"]),
    "a comma for a point": (
        bat(("644.3", "644,3")),
        "profile mine.toml",
        ["cannot be parsed", "point"],
    ),
    "digits of another script": (bat(("644.3", "٦٤٤")), "profile mine.toml", ["cannot be parsed"]),
    "a date for a number": (bat(("644.3", "2026-01-02")), "profile mine.toml", ["finite number"]),
    "a number of 400 digits": (
        bat(("644.3", "1" + "0" * 400)),
        "profile mine.toml",
        ["density", "finite number"],
    ),
    "a number of 5000 digits": (bat(("644.3", "1" * 5000)), "profile mine.toml", ["mine.toml"]),
    "a key twice": (
        bat(('name = "r161"', 'name = "a"\nname = "b"')),
        "show mine.toml",
        ["overwrite"],
    ),
    "a name of two lines": (bat(('"r161"', r'"a\nb"')), "certify mine.toml", ["name", "printable"]),
    "a name that paints": (bat(('"r161"', r'"\u001b[31m"')), "certify mine.toml", ["printable"]),
    "a name without end": (bat(('"r161"', f'"{LONG}"')), "certify mine.toml", ["100 printable"]),
    "an outline of 5000": (
        bat(
            (r"\[0, 2,.*?\]", str([i / 150 for i in range(5001)])),
            (r"\[2.2991.*?\]", str([2.0] * 5001)),
        ),
        "profile mine.toml",
        ["at most 100 items"],
    ),
    "an empty outline": (bat((r"\[0, 2,.*?\]", "[]")), "profile mine.toml", ["at least 2 items"]),
    "stations without diameters": (
        bat((r"\[2.2991.*?\]", "[2, 2]")),
        "profile mine.toml",
        ["2 stations, but z has 12"],
    ),
    "a wall of nothing": (
        file(
            "mine.toml",
            'name = "a"\ntitle = "b"\nbase = "ea70"\nwall_factor = { value = 1e-9, '
            'unit = "1", source = "x", verified = false }',
        ),
        "profile mine.toml",
        ["wall_factor", "0.2 to 5"],
    ),
    "a weight beyond the knob": (
        added(R161, "[body.lumps]", name='"w" -', z="40 in", mass="1 oz"),
        "profile mine.toml",
        ["lump 'w'", "beyond the knob"],
    ),
    "an empty file": (file("mine.toml", ""), "profile mine.toml", ["mine.toml", "missing"]),
    "a spreadsheet": (file("mine.toml", b"PK\x03\x04" + bytes(99)), "show mine.toml", ["parsed"]),
    "UTF-16": (file("mine.toml", R161.encode("utf-16")), "show mine.toml", ["not UTF-8 text"]),
    "Latin-1": (
        file("mine.toml", "title = 'Schläger'".encode("latin-1")),
        "show mine.toml",
        ["UTF-8"],
    ),
    "a NUL": (file("mine.toml", R161.replace("wood", "w\0d")), "show mine.toml", ["mine.toml"]),
    "a file of 60 GB": (
        lambda at, _: os.truncate(os.open(at / "mine.toml", os.O_CREAT | os.O_WRONLY), 60 << 30),
        "show mine.toml",
        ["mine.toml", "more than 20 MB"],
    ),
    "a bat measured in meters": (
        changed("m.toml", MEASURED, ('value = 34, unit = "in"', 'value = 34, unit = "m"')),
        "fit-bat m.toml --out n.toml",
        ["length", "is the unit", "'in'"],
    ),
    # rules and balls
    "10^9 attempts": (
        changed("mine.toml", RULES, ("attempts = { value = 12", "attempts = { value = 1000000000")),
        TESTED,
        ["attempts", "2 to 1000"],
    ),
    "no speed at the wall": (
        changed(
            "mine.toml", RULES, (r"wall_speeds = \{ value = \[.*?\]", "wall_speeds = { value = []")
        ),
        TESTED,
        ["wall_speeds", "at least 1 item"],
    ),
    "a ball out of the catalog": (
        changed("mine.toml", RULES, ('\nball = ".*?"', '\nball = "../x"')),
        TESTED,
        ["ball = '../x'"],
    ),
    "a ball of stone": (
        changed(
            "ball.toml", BALL, (r"stiffness = \{ value = [\d.e]+", "stiffness = { value = 1e14")
        ),
        "profile r161 --ball ball.toml",
        ["compressed by 1 cm", "1e7 N"],
    ),
    # session.json
    "100 000 brackets": (session("[" * 100_000), "reduce r", ["r/session.json", "nested"]),
    "a channel that leads out": (
        renamed("../../../../etc/passwd"),
        "reduce r",
        ["channels", "../../../../etc/passwd"],
    ),
    "a channel from the root": (renamed("/etc/passwd"), "reduce r", ["'/etc/passwd'", "letters"]),
    "a channel with a NUL": (renamed("a\0b"), "reduce r", ["channels", "letters"]),
    "a stage that leads out": (
        session(lambda d: d["channels"].update({"..": d["channels"].pop("impact")})),
        "reduce r --out o",
        ["channels = '..'", "letters"],
    ),
    "a record that is a link": (
        linked("impact/gates.csv", "../../outside"),
        "reduce r",
        ["impact/gates.csv", "file = 'a link'"],
    ),
    "a record that links to itself": (
        linked("impact/gates.csv", "gates.csv"),
        "reduce r",
        ["impact/gates.csv", "file = 'a link'"],
    ),
    "a record that is a pipe": (
        piped("impact/gates.csv"),
        "reduce r",
        ["impact/gates.csv", "file = 'a pipe'"],
    ),
    "records that are a pipe": (
        piped("session.json"),
        "reduce r",
        ["r/session.json", "is not a file"],
    ),
    "a form that is a pipe": (
        lambda at, _: (
            form()(at, at),
            (at / "r" / "laboratory.toml").unlink(),
            os.mkfifo(at / "r" / "laboratory.toml"),
        ),
        "reduce r",
        ["laboratory.toml", "not a file"],
    ),
    "a file that no session lists": (
        lambda at, records: (
            session(lambda _: None)(at, records),
            (at / "r/impact/more.csv").write_text(""),
        ),
        "reduce r",
        ["impact/more.csv", "is not listed in r/session.json"],
    ),
    "a limit changed": (
        lambda at, records: (
            session(lambda _: None)(at, records),
            changed(
                "r/procedure.toml",
                (records / "procedure.toml").read_text(),
                ("limit = { value = 1.2", "limit = { value = 2.2"),
            )(at, records),
        ),
        "reduce r",
        ["procedure.toml", "was changed after session.json was written"],
    ),
    "a simulation that says nothing": (
        session(lambda d: d.update(simulation={}, laboratory="National Bat Laboratory")),
        "reduce r --out o",
        ["simulation.", "missing"],
    ),
    "a key of a session twice": (
        session('{"schema": 1, "bat": "r161", "bat": "ea70"}'),
        "reduce r",
        ["'bat'", "twice"],
    ),
    "NaN in JSON": (session('{"schema": NaN}'), "reduce r", ["NaN is not a JSON number"]),
    "1e999 in JSON": (session('{"schema": 1e999}'), "reduce r", ["1e999 is not finite"]),
    "a session's key mistyped": (
        session(lambda d: d.update(calibraton=d.pop("calibration"))),
        "reduce r",
        ["did you mean calibration?"],
    ),
    "a record's kind mistyped": (
        session(lambda d: d["channels"]["impact"]["gates"].update(record="gate")),
        "reduce r",
        ["did you mean gates"],
    ),
    "rows as a text": (
        session(lambda d: d["channels"]["impact"]["gates"].update(rows="96")),
        "reduce r",
        ["channels.impact.gates.rows = '96'", "integer"],
    ),
    "a bat that is a number": (session(lambda d: d.update(bat=161)), "reduce r", ["bat = 161"]),
    "a constant as a text": (
        constant("impact.encoder.scale", value="1"),
        "reduce r",
        ["scale.value = '1'", "number"],
    ),
    "a constant that is true": (
        constant("impact.encoder.scale", value=True),
        "reduce r",
        ["scale.value = True", "number"],
    ),
    "a constant of 400 digits": (
        constant("impact.encoder.scale", value=10**400),
        "reduce r",
        ["scale.value", "number"],
    ),
    "a clock that stands": (
        constant("impact.gates.clock", value=0),
        "reduce r",
        ["impact.gates.clock", "0.5 to 2"],
    ),
    "a scale known to 1000 times": (
        constant("impact.encoder.scale", u=1000),
        "reduce r",
        ["scale.u = '1000'", "0 to 1.5"],
    ),
    "gates behind the ball": (
        constant("impact.gates.distance_0", value=-1),
        "reduce r",
        ["distance_0", "0 to 100 m"],
    ),
    "another planet": (constant("hall.gravity", value=1.6), "reduce r", ["9 to 11 m/s^2"]),
    "a session in UTF-16": (session("{}".encode("utf-16")), "reduce r", ["not UTF-8 text"]),
    "rules of an empty file": (
        lambda at, records: (
            session(lambda d: d.update(procedure_sha256=hashlib.sha256(b"").hexdigest()))(
                at, records
            ),
            (at / "r/procedure.toml").write_text(""),
        ),
        "reduce r",
        ["procedure.toml", "missing"],
    ),
    # tables of a session
    "a time of words": (record(GATES, _last_cell("soon")), "reduce r", ["time_s = 'soon'"]),
    "a time in minutes and seconds": (record(GATES, _last_cell("0:03")), "reduce r", ["'0:03'"]),
    "a time beyond all": (record(GATES, _last_cell("1e300")), "reduce r", ["up to 1e+18"]),
    "a time before the others": (
        record(GATES, _last_cell("-5")),
        "reduce r",
        ["clears before it breaks"],
    ),
    "a decimal comma": (
        record(GATES, _last_cell("1,5")),
        "reduce r",
        ["gates.csv", "cells", "decimal commas"],
    ),
    "semicolons": (record(GATES, lambda t: t.replace(",", ";")), "reduce r", ["semicolon"]),
    "a row twice": (
        record(GATES, lambda t: t + t.splitlines()[-1]),
        "reduce r",
        ["session.json says"],
    ),
    "a column twice": (
        record(GATES, lambda t: "\n".join(f"{line},{line.split(',')[-1]}" for line in t.split())),
        "reduce r",
        ["time_s", "twice"],
    ),
    "a shot numbered twice": (
        record(GATES, lambda t: re.sub(r"(?m)^1,", "0,", t)),
        "reduce r",
        ["shot = 1", "missing"],
    ),
    "a shot numbered 10^18": (
        record(GATES, lambda t: re.sub(r"(?m)^1,", "1e18,", t)),
        "reduce r",
        ["shot = 1", "missing"],
    ),
    "counts cut short": (record(ENCODER, lambda t: t[: len(t) // 2]), "reduce r", ["cut short"]),
    "a header alone": (record(ENCODER, lambda t: t.split()[0]), "reduce r", ["no rows"]),
    "counts in UTF-16": (record(ENCODER, lambda t: t.encode("utf-16")), "reduce r", ["not text"]),
    "a quote left open": (
        record(GATES, lambda t: t.replace("\n1,", '\n"1,', 1)),
        "reduce r",
        ["gates"],
    ),
    # another laboratory's form
    "a table elsewhere": (
        form(('file = "gates.csv"', 'file = "../../../etc/passwd"')),
        "reduce r",
        ["is outside r"],
    ),
    "a table of the root": (
        form(('file = "gates.csv"', 'file = "/etc/passwd"')),
        "reduce r",
        ["is outside r"],
    ),
    "a channel's name elsewhere": (
        form((r"\[channels.impact.gates\]", '[channels.impact."../../x"]')),
        "reduce r --out o",
        ["'../../x'", "letters"],
    ),
    "rules elsewhere": (
        form(('"astm-f1881"', '"../rules.toml"')),
        "reduce r",
        ["'../rules.toml'", "is outside r"],
    ),
    "a form's key mistyped": (form(("customer", "costumer")), "reduce r", ["mean customer?"]),
    "an axis mistyped": (form((r"\{ item = 1 \}", "{ itm = 1 }")), "reduce r", ["mean item?"]),
    "an index as a text": (form((r"\{ item = 1 \}", '{ item = "1" }')), "reduce r", ["integer"]),
    "a unit of another kind": (form(('unit = "oz"', 'unit = "in"')), "reduce r", ["kg, g, oz, lb"]),
    "a value with a comma": (
        form(("21.6535", "21,6535")),
        "reduce r",
        ["laboratory.toml", "parsed"],
    ),
    "a 13th month": (form(("2026-11-20", "2026-13-20")), "reduce r", ["laboratory.toml", "parsed"]),
    "a constant without quotes": (
        form(('"bench.scale.zero" =', "bench.scale.zero =")),
        "reduce r",
        ["quotes around"],
    ),
    "a form not filled in": (
        form(('bat = "r161"', 'bat = "?"')),
        "reduce r",
        ["line 5: bat; not filled in"],
    ),
    # clips and their calibration
    "a rate as a text": (clip('frames_per_second = "1000"'), f"{TRACK} cal.toml", ["number"]),
    "a rate that is true": (clip("frames_per_second = true"), f"{TRACK} cal.toml", ["number"]),
    "a rate mistyped": (
        clip("frame_per_second = 1"),
        f"{TRACK} cal.toml",
        ["mean frames_per_second"],
    ),
    "a camera that sees nothing": (
        clip(FPS + CAMERA.replace("100.0", "0.0")),
        f"{TRACK} cal.toml",
        ["camera", "focal lengths"],
    ),
    "a camera behind the wall": (
        clip(FPS + CAMERA.replace("0.0, 1.0]\n", "0.0, -1.0]\n")),
        f"{TRACK} cal.toml",
        ["camera", "does not see the ball's plane"],
    ),
    "stamps that are missing": (
        clip('timestamps = "no.csv"'),
        f"{TRACK} cal.toml",
        ["no.csv", "cannot be read"],
    ),
    "stamps that fall": (
        clip('timestamps = "t.csv"', t="\n".join(map(str, range(9, 0, -1)))),
        f"{TRACK} cal.toml",
        ["t.csv", "later than the one before"],
    ),
    "stamps from a device": (
        clip('timestamps = "/dev/zero"'),
        f"{TRACK} cal.toml",
        ["is not a file"],
    ),
    "a calibration from a device": (
        clip(FPS),
        f"{TRACK} /dev/zero",
        ["/dev/zero", "is not a file"],
    ),
    "a clip cut short": (
        clip(FPS, b"\x93NUMPY\x01"),
        f"{TRACK} cal.toml",
        ["clip.npy", "cut short"],
    ),
    "a clip of objects": (
        clip(FPS, np.array([[[b"x"]]], dtype="S1")),
        f"{TRACK} cal.toml",
        ["picture", "8 or 16 bits"],
    ),
    "a clip of no pixels": (
        clip(FPS, np.zeros((9, 0, 4), np.uint8)),
        f"{TRACK} cal.toml",
        ["pixel"],
    ),
    "a clip of an archive": (
        clip(FPS, b"PK\x05\x06" + bytes(18)),
        f"{TRACK} cal.toml",
        ["clip.npy", "cannot be read"],
    ),
    "stamps of one moment": (
        clip('timestamps = "t.csv"', t="\n".join(f"{i}e-300" for i in range(9))),
        f"{TRACK} cal.toml",
        ["t.csv", "1e-08 s later"],
    ),
}


@pytest.fixture(scope="module")
def records(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a whole session."""
    folder = tmp_path_factory.mktemp("records")
    save_session(our_session("astm-f1881"), folder)
    return folder


@pytest.mark.parametrize("case", CASES)
def test_wrong_input_gives_one_line(case: str, records: Path, run: Run, tmp_path: Path) -> None:  # noqa: F811
    """Exit code 2, one line on stderr, no change to the folder, and little time and memory."""
    setup, command, words = CASES[case]
    setup(tmp_path, records)
    before = sorted(tmp_path.rglob("*"))
    began, most = time.process_time(), resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    code, out, err = run(*_words(command))
    assert (code, out, err.count("\n")) == (2, "", 1), err
    for word in words:
        assert word in err
    assert sorted(tmp_path.rglob("*")) == before
    assert time.process_time() - began < 10
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - most < 400_000  # kB


def test_too_little_memory_is_one_line(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:  # noqa: F811
    """A number of laboratories that fits into no address space; an error without a size."""
    little = "virtual-lab: not enough memory{}; allowed: smaller numbers or files\n"
    words = ("coverage", "--laboratories", "1" + "0" * 18)
    assert run(*words) == (2, "", little.format(": 6.94 EiB"))

    def fill(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr(np, "arange", fill)
    assert run(*words) == (2, "", little.format(""))


def _words(command: str) -> list[str]:
    """Return the words of a command; quotes hold words together."""
    return [word[1:-1] if word[0] == "'" else word for word in re.findall(r"'[^']*'|\S+", command)]
