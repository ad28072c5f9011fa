"""Functions of the rehearsal bench's commands."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab.commands.output import Answer
from virtual_lab.errors import InputError, of_extra
from virtual_lab.files.folders import DayFolder, NewFolder
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.parameters import (
    OUT,
    AnyLaboratory,
    File,
    Folder,
    OperatorName,
    OperatorSeed,
    Port,
    Seed,
    Trainees,
)
from virtual_lab.sheets import AnyScenario

if TYPE_CHECKING:
    from virtual_lab.bench.entrance.operated_day import RehearsedDay
    from virtual_lab.output.result import StudyResult


def day(
    *,
    scenario: AnyScenario = "plain-day",
    operator: OperatorName | None = None,
    script: File | None = None,
    seed: Seed | None = None,
    operator_seed: OperatorSeed = 0,
    laboratory: AnyLaboratory | None = None,
    day: Folder | None = None,
    port: Port = 8377,
    host: str = "127.0.0.1",
    tls_certificate: File | None = None,
    tls_key: File | None = None,
    trainees: Trainees = 1,
    exam: File | None = None,
    replay: File | None = None,
    open: bool = False,
    out: Folder | None = None,
    progress: Progress = quiet,
) -> RehearsedDay | StudyResult | Answer:
    """Carry out a test day, action by action.

    You learn the cost of each decision. You do this on a page in the browser (needs the extra
    'bench'). A simulated operator or a script can do it for you. The option --out of the command
    then saves the log, the sealed truth and the debrief (debrief.html).

    Parameters
    ----------
    scenario
        Scenario of the day: a name in the catalog or a .toml file.
    operator
        Simulated operator who carries out the day instead of you.
    script
        A .json file of actions to carry out. The error about an unknown name or argument lists the
        allowed ones.

        Example: ``{"actions": [{"do": "tare"}]}``.
    seed
        Seed of the laboratory. By default a random seed.
    operator_seed
        Seed of the operator's mistakes.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog. A day that is continued keeps its own.
    day
        Folder of the day. If it contains a day, this day is continued. By default a new folder in
        out/, named after the scenario.
    port
        Port number of the page.
    host
        Host name or IP address of the page. Other computers can reach the page only with TLS.
    tls_certificate
        Certificate chain for TLS, a PEM file.
    tls_key
        Private key for TLS, a PEM file.
    trainees
        Number of trainees, each with a separate browser and folder.
    exam
        File of an exam for a class, with title, scenario and trainees.
    replay
        Log of a handed-in day, day.sqlite. The day is repeated, and a table of its entries is
        printed. With `open`, a page shows each entry instead.
    open
        Open the page in a browser.
    out
        Folder into which the caller saves the result.
    progress
        Function that is called with a sentence, which is empty while the page is served.
    """
    scenario = str(scenario)
    script, day, exam, replay = map(_path, (script, day, exam, replay))
    tls_certificate, tls_key = _path(tls_certificate), _path(tls_key)
    if sum(map(bool, (operator, script, replay))) > 1:
        allowed = "{operator}, {script} and {replay} exclude each other"
        raise InputError("", "{replay}" if replay else "{script}", None, allowed)
    if replay and not open:
        from virtual_lab.bench.entrance.review import replay as played_back

        return played_back(replay)
    if operator or script:
        from virtual_lab.bench.entrance.operated_day import rehearse as run

        return run(
            scenario,
            operator=operator or "book",
            script=script,
            seed=seed,
            operator_seed=operator_seed,
        )
    if out:
        allowed = "needs {operator} or {script}; the page saves its day in the folder of {day}"
        raise InputError("", "{out}", None, allowed)
    if (tls_certificate is None) != (tls_key is None):
        raise InputError("", "{tls_certificate}", None, "is needed together with {tls_key}")
    tls = (tls_certificate, tls_key) if tls_certificate and tls_key else None
    progress("")
    served: dict[str, Any] = {"port": port, "host": host, "tls": tls, "browser": open}
    if replay:
        from virtual_lab.bench.entrance.review import played_folder

        return _serve_page(None, played_folder(replay), [], **served)
    if exam is None:
        names = [f"{n:02}" for n in range(1, trainees + 1)] if trainees > 1 else []
        return _serve_page(scenario, day, names, seed=seed, **served)
    if trainees > 1:
        allowed = "leave it out: the file of {exam} names the trainees"
        raise InputError("", "{trainees}", trainees, allowed)
    from virtual_lab.bench.day.exam import load_class

    exam_class = load_class(exam)
    return _serve_page(
        exam_class.scenario, day, exam_class.trainees, seed=seed, exam=exam_class.title, **served
    )


def _serve_page(
    scenario: str | None, folder: Path | None, trainees: Sequence[str], **served: Any
) -> Answer:
    """Serve the page until Ctrl-C. Without a scenario, the page replays a day."""
    from virtual_lab.files import check_writable, first_free

    of_extra("uvicorn", "bench", "the page")
    from virtual_lab.bench.day.scenario import load_scenario
    from virtual_lab.bench.entrance.serve import serve

    target = folder or first_free(Path(OUT) / Path(scenario or "").stem)
    check_writable(target, "day")
    each = {f"trainee {name}": target / name for name in trainees}
    say = partial(print, file=sys.stderr, flush=True)
    entry = load_scenario(scenario) if scenario else None
    serve(each or {"": target}, entry, say=say, **served)
    return Answer(document={"day": str(target)}, text=str(target))


def summary(folder: Folder) -> StudyResult:
    """Print a table of all days in the folders below a folder, one row per day."""
    from virtual_lab.bench.entrance.review import summary as run

    return run(Path(folder))


def branch(day: DayFolder, entry: int, folder: NewFolder) -> Answer:
    """Start a new day with the first entries of a day that was handed in, for practice.

    The entries of the log are copied up to number ENTRY, counted
    from 1 and included. With 0, no entry is copied. If another laboratory supplied the first
    entries, ENTRY must be at least the number of these entries.
    """
    from virtual_lab.bench.machines.stored_day import StoredDay

    StoredDay.branch(Path(day), entry, Path(folder))
    text = f"practice day with the first {entry} entries, in {folder}\n"
    text += f"continue with: virtual-lab rehearse --day {folder} --open"
    return Answer(document={"day": str(folder)}, text=text)


def check(scenario: AnyScenario) -> StudyResult:
    """Check the scenario of a rehearsal by six simulated test days.

    The operators `book` and `expert` carry out three test days each. One row per test day is
    returned, with its duration [min], its number of shots, and the faults that the operator named.
    """
    from virtual_lab.bench.entrance.review import check_scenario

    return check_scenario(str(scenario))


def _path(path: File | None) -> Path | None:
    return None if path is None else Path(path)
