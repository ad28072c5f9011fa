"""The table of commands, in the sections of the help."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from virtual_lab.commands.command import Command
from virtual_lab.commands.output import PRINTED, STUDY, TABLE, Answer, Output
from virtual_lab.errors import InputError
from virtual_lab.output.tables import table_text

CAMPAIGN, REHEARSE = "virtual_lab.commands.campaign", "virtual_lab.commands.rehearse"
PAGE = ("virtual_lab.page.opening", "open_page")
CALIBRATION = "New calibration file, .toml. A picture of the residuals is beside it."
CHARTED = Output(table=True, picture=True)


def _require_clip(values: Mapping[str, Any]) -> None:
    """Raise `InputError` for a file that is not a clip, and then for a scale that is unknown."""
    from virtual_lab.video.clips.calibration_file import read_calibration
    from virtual_lab.video.clips.reading import open_source

    open_source(Path(values["clip"]))
    is_known = values.keys() & {"ball", "scale"} or values.get("ruler") == "gravity"
    read_calibration(values.get("calibration"), needs_length=not is_known)


def _board(folder: Path) -> Answer:
    """Return the answer for the folder of a board's pictures."""
    document = {"pictures": str(folder / "pictures"), "truth": str(folder / "truth")}
    return Answer(document=document, text="", files=[folder / "pictures"])


def _form(path: Path) -> Answer:
    """Return the answer for the path of an empty form."""
    return Answer(
        document={"folder" if path.is_dir() else "file": str(path)},
        text=f"empty, to fill in: {path}",
    )


def _answer_sweep(table: Any) -> Answer:
    """Return the answer for the table of a sweep: text up to the error, JSON and files."""
    document = json.loads(table.to_json(orient="records"))
    verdicts = table["verdict"].value_counts().items()
    text = f"tests: {', '.join(f'{count} {verdict}' for verdict, count in verdicts)}\n\n"
    text += table_text(table.loc[:, :"error"].to_dict("records"))
    text += "\n\nMore columns: in the table as CSV, and in JSON"
    return Answer(document=document, text=text, table=table)


SECTIONS: Mapping[str, Sequence[Command]] = {
    "Test a bat": (
        Command(
            "certify",
            example="r161 --procedure bbcor --seed 7",
            question="Does this bat pass?",
            saving="Certificate.save",
            output=Output(folder="{bat}-{procedure}", page="certificate.html"),
        ),
        Command(
            "score",
            question="How far from the truth is this certificate?",
            example="out/r161-bbcor-seed-7",
        ),
        Command(
            "reduce",
            example="out/r161-bbcor-seed-7/records",
            saving="Certificate.save",
            output=Output(keeps=True),
        ),
        Command("verify", example="out/r161-bbcor-seed-7", output=TABLE),
        Command("report", example="out/r161-bbcor-seed-7 out/other"),
        Command("open", PAGE, example="out", output=PRINTED),
        Command(
            "template",
            example="astm-f1881 forms",
            question="How do I enter measurements of my own?",
            output=Output(answer=_form),
        ),
        Command(
            "rehearse",
            (REHEARSE, "day"),
            example="--scenario plain-day --operator expert --out day",
            output=Output(keeps=True, page="debrief.html"),
            variants=(
                Command("rehearse summary", (REHEARSE, "summary"), example="days", output=STUDY),
                Command(
                    "rehearse branch", (REHEARSE, "branch"), example="day 4 again", output=PRINTED
                ),
                Command("rehearse check", (REHEARSE, "check"), example="mine.toml", output=STUDY),
            ),
        ),
    ),
    "Bats and the catalog": (
        Command("list", "shelf", example="bats", output=TABLE),
        Command("show", example="r161", output=PRINTED),
        Command("profile", question="Which bat hits harder?", example="r161 ea70"),
        Command(
            "fit-bat",
            example="measured.toml --out mine.toml",
            output=Output(table=True, file="New bat file, .toml.", method="write"),
        ),
        Command("sensitivity", example="r161"),
        Command("slope", example="r161 ea70"),
    ),
    "Studies of laboratories and procedures": (
        Command(
            "sweep",
            example="r161 ea70 --laboratories 2",
            output=Output(table=True, frame="", answer=_answer_sweep),
        ),
        Command("coverage", example="r161 --summed --laboratories 20"),
        Command("operating", question="Who passes by chance?", example="ea70 --laboratories 20"),
        Command("interlab", example="laboratories.toml --predict"),
        Command("bias", example="--procedure bbcor", options=("procedure",)),
        Command("faults", example="gate-moved --laboratories 2"),
        Command(
            "plan",
            question="How do I reach a smaller uncertainty?",
            example="bbcor --target-u 0.0015",
        ),
        Command("laboratory", example="out/r161-bbcor-seed-7 --out ours", output=STUDY),
        Command("twin", example="out/r161-bbcor-seed-7"),
        Command("critique", example="r161 ea70 --laboratories 2"),
        Command("daily", example="--days 12 --baseline 6", output=replace(CHARTED, folder="daily")),
        Command(
            "campaign",
            words="Test bats in very many laboratories.",
            variants=(
                Command(
                    "campaign run",
                    "campaign",
                    example="study.toml --out campaign",
                    output=Output(into="folder"),
                ),
                Command(
                    "campaign resume", (CAMPAIGN, "resume"), example="campaign", output=PRINTED
                ),
                Command("campaign check", (CAMPAIGN, "check"), example="campaign", output=PRINTED),
                Command(
                    "campaign summary", (CAMPAIGN, "summary"), example="campaign", output=STUDY
                ),
            ),
        ),
    ),
    "Camera": (
        Command(
            "track",
            example="clip.mp4 --ball 73mm --phone --fps 240",
            question="How fast is the ball in my clip?",
            output=Output(folder="{clip}-track", beside="clip", picture=True),
            require=_require_clip,
        ),
        Command(
            "calibrate",
            example="pictures --board chessboard:9x6:40mm --out camera.toml",
            output=Output(file=CALIBRATION),
        ),
        Command(
            "board",
            example="--board chessboard:9x6:40mm --views 3",
            output=Output(folder="board", into="folder", answer=_board),
        ),
    ),
    "Speed and accuracy": (
        Command(
            "model",
            words="Compare the models of the simulation.",
            variants=(
                Command(
                    "model chart",
                    "chart",
                    example="motion",
                    output=replace(CHARTED, folder="chart-{part}"),
                ),
                Command(
                    "model stability",
                    "stability",
                    example="camera",
                    output=replace(CHARTED, folder="stability-{part}"),
                ),
            ),
        ),
    ),
}


def every_command() -> dict[str, Command]:
    """Return the commands that call a function, keyed by name."""
    rows = [row for rows in SECTIONS.values() for each in rows for row in (each, *each.variants)]
    return {each.name: each for each in rows if not each.words}


def of_other_packages(taken: Collection[str], name: str = "") -> Iterator[Command | InputError]:
    """Yield one command per entry point of other packages, or only the command called `name`.

    An entry point is a function that carries out a study. An error takes the place of a function
    that cannot be a command, or whose name is among the names `taken`.
    """
    from importlib.metadata import entry_points

    used = set(taken)
    for each in entry_points(group="virtual_lab.commands"):
        if name not in ("", each.name):
            continue
        command = Command(each.name, (each.module, each.attr))
        try:
            if each.name in used:
                raise ValueError("another command has this name")
            command.require_rules()
        except (AssertionError, OSError, SyntaxError, ValueError) as fault:
            refusal = InputError(each.value, each.name, None, f"is not a command: {fault}")
            refusal.__cause__ = fault
            yield refusal
        else:
            used.add(each.name)
            yield command
