"""The command of the rehearsal bench."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from virtual_lab.cli.plumbing import Answer, command, seed_option, usage

if TYPE_CHECKING:
    from virtual_lab.bench.entrance.operated_day import RehearsedDay
    from virtual_lab.output.result import StudyResult


@command("rehearse", keeps=True)
@click.option(
    "--scenario",
    default="plain-day",
    show_default=True,
    help="The day: a name (see data/README.md) or a .toml file.",
)
@click.option(
    "--operator",
    type=click.Choice(["expert", "careful", "book", "careless", "cheating"]),
    help="Simulated operator who takes the day instead of you.",
)
@click.option(
    "--script",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help='A .json file of actions to run: {"actions": [{"do": "tare"}, …]}.',
)
@seed_option(" of the laboratory  [default: a random seed]", None)
@click.option(
    "--operator-seed",
    type=click.IntRange(min=0),
    default=0,
    show_default=True,
    metavar="NUMBER",
    help="Seed of the operator's mistakes.",
)
@click.option(
    "--day",
    type=click.Path(path_type=Path),
    metavar="FOLDER",
    help="Folder of the day; a day that is already there is continued.  "
    "[default: out/SCENARIO, or with -2, -3, …]",
)
@click.option(
    "--port",
    type=click.IntRange(1024, 65535),
    default=8377,
    show_default=True,
    metavar="NUMBER",
    help="Port of the page.",
)
@click.option(
    "--host",
    default="127.0.0.1",
    show_default=True,
    metavar="ADDRESS",
    help="Address of the page; other computers can reach it only with TLS.",
)
@click.option(
    "--tls-certificate",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Certificate chain, PEM.",
)
@click.option("--tls-key", type=click.Path(path_type=Path), metavar="FILE", help="TLS key, PEM.")
@click.option(
    "--trainees",
    type=click.IntRange(1, 50),
    default=1,
    show_default=True,
    metavar="NUMBER",
    help="Number of trainees, each with a separate browser and folder.",
)
@click.option(
    "--exam",
    type=click.Path(path_type=Path),
    metavar="CLASS.TOML",
    help="Serve an exam to a class; the file has title, scenario and trainees.",
)
@click.option(
    "--replay",
    type=click.Path(path_type=Path),
    metavar="FILE",
    help="Repeat a day from its log, day.sqlite, after it was handed in: a table of its entries, "
    "with --open a page for each entry.",
)
@click.option("--open", "browser", is_flag=True, help="Open the page in a browser.")
def day_command(
    scenario: str,
    operator: str | None,
    script: Path | None,
    seed: int | None,
    operator_seed: int,
    day: Path | None,
    port: int,
    host: str,
    tls_certificate: Path | None,
    tls_key: Path | None,
    trainees: int,
    exam: Path | None,
    replay: Path | None,
    browser: bool,
) -> RehearsedDay | StudyResult | Answer:
    """Carry out a test day action by action, and learn the cost of each decision.

    You do this on a page in the browser (needs the extra 'bench'), or a simulated operator or a
    script does it for you; then --out saves the log, the sealed truth and the debrief.
    """
    if sum(map(bool, (operator, script, replay))) > 1:
        usage("--operator, --script and --replay exclude each other")
    if replay and not browser:
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
    if click.get_current_context().params.get("out"):
        usage("--out goes with --operator or --script; the page keeps its day in --day")
    if (tls_certificate is None) != (tls_key is None):
        usage("--tls-certificate and --tls-key go together")
    tls = (tls_certificate, tls_key) if tls_certificate and tls_key else None
    served: dict[str, Any] = {"port": port, "host": host, "tls": tls, "browser": browser}
    if replay:
        from virtual_lab.bench.entrance.review import played_folder

        return _served(None, played_folder(replay), [], **served)
    if exam is None:
        names = [f"{n:02}" for n in range(1, trainees + 1)] if trainees > 1 else []
        return _served(scenario, day, names, seed=seed, **served)
    if trainees > 1:
        usage("--exam names the trainees, --trainees counts them")
    from virtual_lab.bench.day.exam import load_class

    found = load_class(exam)
    return _served(found.scenario, day, found.trainees, seed=seed, exam=found.title, **served)


def _served(
    scenario: str | None, folder: Path | None, trainees: Sequence[str], **served: Any
) -> Answer:
    """Serve the page until it is stopped; without a scenario, to play a day back."""
    from importlib.util import find_spec

    from virtual_lab.errors import InputError, with_extra
    from virtual_lab.files import first_free

    if not (find_spec("starlette") and find_spec("uvicorn")):
        raise InputError("", "the page needs the extra 'bench'", None, with_extra("bench"))
    from virtual_lab.bench.day.scenario import load_scenario
    from virtual_lab.bench.entrance.serve import serve

    target = folder or first_free(Path("out") / Path(scenario or "").stem)
    each = {f"trainee {name}": target / name for name in trainees}
    serve(
        each or {"": target},
        load_scenario(scenario) if scenario else None,
        say=lambda text: click.echo(text, err=True),
        **served,
    )
    return Answer(document={"day": str(target)}, text=str(target))


@command("summary", keeps=True, table=True)
@click.argument("folder", type=click.Path(path_type=Path))
def summary(folder: Path) -> StudyResult:
    """Make one table of all days in folders below FOLDER."""
    from virtual_lab.bench.entrance.review import summary as run

    return run(folder)


@command("trends", keeps=True, table=True)
@click.argument("folder", type=click.Path(path_type=Path))
def trends(folder: Path) -> StudyResult:
    """Show learning curves, by score and by fault: the days of each folder below FOLDER."""
    from virtual_lab.bench.entrance.review import trends as run

    return run(folder)


@command("branch")
@click.argument("day", type=click.Path(path_type=Path))
@click.argument("entry", type=int)
@click.argument("folder", type=click.Path(path_type=Path))
def branch(day: Path, entry: int, folder: Path) -> Answer:
    """Take a DAY that was handed in again from an ENTRY, as practice in FOLDER."""
    from virtual_lab.bench.machines.stored_day import StoredDay

    StoredDay.branch(day, entry, folder)
    return Answer(
        document={"day": str(folder)},
        text=f"go on with: virtual-lab rehearse --day {folder} --open",
    )


@command("check", keeps=True, table=True)
@click.argument("scenario", metavar="SCENARIO.TOML")
def check(scenario: str) -> StudyResult:
    """Try a scenario of your own: minutes, shots, and what an expert finds."""
    from virtual_lab.bench.entrance.review import check_scenario

    return check_scenario(scenario)


@click.pass_context
def _day_or_more(context: click.Context, /, **asked: object) -> object:
    """Take a day where no command of the group was named."""
    return None if context.invoked_subcommand else context.invoke(day_command, **asked)


rehearse = click.Group(
    "rehearse",
    callback=_day_or_more,
    commands=[summary, trends, branch, check],
    params=day_command.params,
    help=day_command.help,
    invoke_without_command=True,
)
