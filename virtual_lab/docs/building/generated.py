"""Pages that the build writes into ``generated``: the reference, and pages kept beside the code.

The descriptions of functions and commands come from docstrings and signatures, as in the program's
help. The catalog pages come from the sheets. The descriptions of columns and keys come from the
fields that write them.
"""

import json
import posixpath
import re
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import click
from sphinx.application import Sphinx

import virtual_lab as vl
from virtual_lab import catalog
from virtual_lab.bench.day.actions import ARGUMENTS
from virtual_lab.bench.day.arguments import Argument
from virtual_lab.bench.day.doubts import fault_sheets
from virtual_lab.bench.day.table import action_table
from virtual_lab.certificate.columns import SHOTS
from virtual_lab.certificate.schema import json_schema
from virtual_lab.cli import cli
from virtual_lab.cli.commands import FunctionCommand, help_text
from virtual_lab.files.column_units import PURE, unit_of
from virtual_lab.files.dictionary import COLUMNS, ENDINGS, PATTERNS, column_meaning
from virtual_lab.records import record_types
from virtual_lab.records.record import AXES

DOCS = Path(__file__).parents[1]
ROOT = DOCS.parents[1]
MADE = DOCS / "generated"
PAGES = {  # pages beside the code, by their page of the site
    "quality": "virtual_lab/studies/README.md",
    "speed": "virtual_lab/fidelity/README.md",
    "benchmarks": "tests/benchmarks/README.md",
    "collision": "virtual_lab/simulation/collision/README.md",
    "data": "data/README.md",
    "structure": "virtual_lab/README.md",
    "contributing": "CONTRIBUTING.md",
    "by-hand": "tests/foreign_laboratory/worked_by_hand.md",
}
LINK = re.compile(r"\]\(([^)#:]*)(#[^)]*)?\)")


def table(head: Sequence[str], rows: Sequence[Sequence[Any]]) -> str:
    """Return a Markdown table. Each cell is converted to a one-line string."""
    lines = [head, ["---"] * len(head), *rows]
    cells = ([" ".join(str(cell).split()).replace("|", "\\|") for cell in line] for line in lines)
    return "\n".join(f"| {' | '.join(line)} |" for line in cells) + "\n"


def relink(text: str, home: str, page: str) -> str:
    """Return a page's text with links within the site instead of links to files.

    `home` is the folder of the text in the repository. `page` is the path of the page in the site,
    relative to DOCS. A link to a file that is not a page of the site becomes a link to its path in
    the repository.
    """

    def link(match: re.Match[str]) -> str:
        if not match[1]:
            return match[0]
        target = posixpath.normpath(posixpath.join(home, match[1]))
        for name, source in PAGES.items():
            if target == source:
                target = f"virtual_lab/docs/generated/pages/{name}.md"
        there = posixpath.relpath(target, posixpath.dirname(f"virtual_lab/docs/{page}"))
        return f"]({there}{match[2] or ''})"

    return LINK.sub(link, text)


def pages() -> Iterator[tuple[str, str]]:
    """Yield name and text of each page that is stored beside the code.

    These are the pages in `PAGES`. Their links are changed to links in the site.
    """
    for name, source in PAGES.items():
        text = (ROOT / source).read_text("utf-8")
        first, *rest = re.split(r"^(?=# )", text, flags=re.MULTILINE)[1:]
        text = first + "".join(re.sub(r"^#", "##", part, flags=re.MULTILINE) for part in rest)
        page = f"generated/pages/{name}.md"
        yield page, relink(text, posixpath.dirname(source), page)


def functions() -> Iterator[tuple[str, str]]:
    """Yield name and text of the reference pages of the public functions and classes.

    There is a page for each section of `help(vl)`, in its order, and one that lists them all.
    """
    links, lines = [], []
    for title, listed in re.findall(r"^(\w.*)\n((?: {4}\w.*\n?)+)", str(vl.__doc__), re.MULTILINE):
        rows = [line.split(maxsplit=1) for line in listed.splitlines()]
        classes = title.startswith("Classes")
        kind, members = ("class", "\n   :members:") if classes else ("function", "")
        parts = [f"{title}\n{'=' * len(title)}\n"]
        parts += [f".. auto{kind}:: virtual_lab.{name}{members}\n" for name, _ in rows]
        links.append(slug(title))
        yield f"generated/functions/{links[-1]}.rst", "\n".join(parts)
        cells = [(f"[{name}](#virtual_lab.{name})", words) for name, words in rows]
        lines += [f"## {title}\n", table(("name", "what it does"), cells)]
    parts = [
        "# Functions\n",
        "Every function is called as `vl.NAME` after `import virtual_lab as vl`.\n",
        *lines,
        "\n".join(["```{toctree}", ":hidden:", "", *links, "```", ""]),
    ]
    yield "generated/functions/index.md", "\n".join(parts)


def slug(title: str) -> str:
    """Return the file name of the page with the heading `title`."""
    return re.sub(r"\W+", "-", title.lower()).strip("-")


def commands() -> Iterator[tuple[str, str]]:
    """Yield one pair: the file name and the text of the page that describes all commands.

    The page describes each command with the same words as the command's help.
    """
    parts = [
        "# Commands\n",
        "Every command also has `--help`. [Exit codes](../how-do-i.md#read-the-exit-codes).\n",
    ]
    for section, members in cli.sections.items():
        parts.append(f"## {section}\n")
        for command in members:
            inner = command.commands.values() if isinstance(command, click.Group) else [command]
            for each in inner:
                above = f"{command.name} " if isinstance(command, click.Group) else ""
                parts += list(command_parts(each, f"{above}{each.name}"))
    yield "generated/commands.md", "\n".join(parts)


def command_parts(command: click.Command, name: str) -> Iterator[str]:
    """Yield heading, description, table of options, and example of a command, as Markdown."""
    yield f"### {name}\n"
    yield (command.help or "").replace("\b", "") + "\n"
    context = click.Context(command, info_name=name)
    rows = []
    for each in command.params:
        record = each.get_help_record(context)
        if isinstance(each, click.Argument) and isinstance(command, FunctionCommand):
            record = (
                each.make_metavar(context),
                help_text(command.command.parameters[str(each.name)]),
            )
        if record:
            rows.append((f"`{record[0]}`", record[1].replace("<", "&lt;").replace("*", "\\*")))
    yield table(("option", "meaning"), rows)
    if isinstance(command, FunctionCommand) and command.command.example:
        yield f"```\nvirtual-lab {command.command.example_line}\n```\n"


def shelves() -> Iterator[tuple[str, str]]:
    """Yield name and text of the catalog pages, one page per kind of entry.

    A page lists all numbers of each sheet.
    """
    for kind in catalog.KINDS:
        parts = [
            f"# Catalog: {kind}\n",
            "`verified`: somebody read the number in the source itself.\n",
        ]
        sources: dict[str, str] = {}
        for entry in vl.shelf(kind).rows:
            if entry.name not in catalog.names(kind):
                continue
            sheet = vl.show(entry.name)
            sources |= sheet.sources
            parts += [f"## {entry.name}\n", f"{sheet.title}\n"]
            if sheet.words:
                words = [(f"`{key}`", value) for key, value in sheet.words.items()]
                parts.append(table(("key", "text"), words))
            rows = [
                (
                    f"`{each.key}`",
                    str(each.value).strip("[]()"),
                    "" if each.unit == "1" else each.unit,
                    each.source,
                    "verified" if each.verified else "no",
                    each.note,
                )
                for each in sheet.numbers
            ]
            if rows:
                parts.append(table(("key", "value", "unit", "source", "verified", "note"), rows))
        if sources:
            parts += ["## Sources\n", table(("source", "what it is"), [*sources.items()])]
        yield f"generated/catalog/{kind}.md", "\n".join(parts)


def dictionary() -> Iterator[tuple[str, str]]:
    """Yield name and text of the page that explains the columns of all tables."""

    def unit(name: str) -> str:
        return "" if unit_of(name) == PURE else f"`{unit_of(name).ucum}`"

    columns = [
        (f"`{name}`", f"`{each.name}`", unit(each.name), each.meaning)
        for name, kind in record_types().items()
        for each in kind.columns.values()
    ]
    known = [(name, column_meaning(name)) for name in COLUMNS]
    tables = [(f"`{name}`", each.unit, each.meaning) for name, each in known if each]
    made = [(f"`{name}`", each.unit, each.meaning) for name, each in PATTERNS.items()]
    endings = [(f"`X_{name}`", words.format("X")) for name, words in ENDINGS.items()]
    shots = [(f"`{each.name.replace('{}', '…')}`", unit(each.name), each.meaning) for each in SHOTS]
    parts = [
        "# Dictionary of columns\n",
        "`datapackage.json` in every result folder gives the same for the tables it holds, with "
        "their types. Units are UCUM codes; a column without one is a number, a word or a yes. "
        "Numbers of shots, balls and so on count from 0.\n",
        "## Columns of the tables of functions and commands\n",
        'Units are as printed, in memory in `table.attrs["units"]`. *Of the row*: the unit in the '
        "column `unit`, or without this column that of the row's quantity.\n",
        table(("column", "unit", "meaning"), tables + made),
        "An ending adds to the meaning of the name before it:\n",
        table(("column", "meaning"), endings),
        "## Index columns of the records\n",
        table(("column", "meaning"), [(f"`{name}`", words) for name, words in AXES.items()]),
        "## Value columns of the records\n",
        table(("record", "column", "unit", "meaning"), columns),
        "## Columns of readings.csv\n",
        "A rig has those of its instruments; … is the name of the procedure's metric.\n",
        table(("column", "unit", "meaning"), shots),
    ]
    yield "generated/dictionary.md", "\n".join(parts)


def schema() -> Iterator[tuple[str, str]]:
    """Yield (file name, text) of two generated files about ``certificate.json``.

    The first is a page with a table of its keys. The second is its JSON Schema.
    """
    whole = json_schema()
    parts = [
        "# Keys of certificate.json\n",
        "The same as a [JSON Schema](certificate.schema.json), draft 2020-12.\n",
    ]
    documents = {"CertificateDocument": whole, **whole["$defs"]}
    for name, definition in documents.items():
        rows = [
            (
                f"`{key}`",
                type_name(each),
                f"`{each['unit']}`" if "unit" in each else "",
                each["description"].replace("``", "`"),
            )
            for key, each in definition.get("properties", {}).items()
        ]
        if rows:
            parts += [f"## {name}\n", table(("key", "type", "unit", "meaning"), rows)]
    yield "generated/schema.md", "\n".join(parts)
    yield "generated/certificate.schema.json", json.dumps(whole, indent=1)


def type_name(described: dict[str, Any]) -> str:
    """Return the type of a JSON Schema property in words, such as ``number or null``.

    ``null`` means that the value may be missing. A property without a stated type is ``any``.
    """
    if "$ref" in described:
        return str(described["$ref"]).rpartition("/")[2]
    if "anyOf" in described:
        return " or ".join(type_name(each) for each in described["anyOf"])
    if described.get("type") == "array" and isinstance(described.get("items"), dict):
        return f"array of {type_name(described['items'])}"
    return str(described.get("type", described.get("const", "any")))


def rehearsal() -> Iterator[tuple[str, str]]:
    """Yield name and text of the page of faults, checks and actions at the rehearsal bench."""
    sheets = action_table().actions
    faults = [
        (
            f"`{name}`",
            sheet.does,
            ", then ".join(sheets[action].title for action in sheet.found_by.actions),
        )
        for name, sheet in fault_sheets().items()
        if sheet.found_by
    ]
    unfound = [(f"`{x.name}`", x.does, x.unfound) for x in fault_sheets().values() if x.unfound]
    actions = [
        (
            f"`{name}`",
            sheet.title,
            ", ".join(map(_argument, ARGUMENTS.get(name, ()))),
            "yes" if sheet.in_book else "",
            f"{sheet.minutes / 60:g}",
            sheet.skipped,
        )
        for name, sheet in sheets.items()
    ]
    parts = [
        "# Faults, checks and actions of a rehearsal\n",
        "## Faults and the checks that reveal them\n",
        "Each check reveals its fault on at least 99 of 100 days.\n",
        table(("fault", "what happens", "check"), faults),
        "No check at the bench reveals these:\n",
        table(("fault", "what happens", "why"), unfound),
        "## Actions of a script\n",
        "A day that is saved contains its actions, `actions.json`. Change the list, and let the "
        "program carry it out with the same scenario and seed:\n",
        "```sh\n"
        "virtual-lab rehearse --operator book --scenario friday --seed 4 --out out/friday\n"
        "virtual-lab rehearse --script out/friday/actions.json --scenario friday --seed 4\n"
        "```\n",
        'An entry is `{"do": "swing", "amplitude": 4}`, for example. The last three are `reduce`, '
        "`give-verdict` and `hand-in`. Arguments in brackets have this default:\n",
        table(("do", "title", "arguments", "in the procedure", "min", "if skipped"), actions),
    ]
    yield "generated/rehearsal.md", "\n".join(parts)


def _argument(argument: Argument) -> str:
    """Return name, default and allowed values of an argument of an action."""
    default = "" if argument.default in (None, "") else f" ({argument.default})"
    allowed = f" {' or '.join(argument.choices)}" if argument.choices else f" {argument.unit}"
    return f"`{argument.name}`{allowed.rstrip()}{default}"


def _write(_app: Sphinx) -> None:
    """Write the pages that changed, and delete those of an earlier state of the code.

    The records of the example laboratory are written as an archive, for the download.
    """
    made = [
        each
        for make in (pages, functions, commands, shelves, dictionary, schema, rehearsal)
        for each in make()
    ]
    stale = {path for path in MADE.rglob("*") if path.is_file() and "gallery" not in path.parts}
    for path in stale - {DOCS / name for name, _ in made}:
        path.unlink()
    for name, text in made:
        path = DOCS / name
        path.parent.mkdir(parents=True, exist_ok=True)
        if not path.exists() or path.read_text("utf-8") != text:
            path.write_text(text, "utf-8")
    shutil.make_archive(
        str(MADE / "records"), "zip", ROOT / "tests" / "foreign_laboratory", "records"
    )


def _relink(_app: Sphinx, page: str, source: list[str]) -> None:
    """Change a page's links to files outside the docs to links to their pages of the site."""
    if not page.startswith("generated/"):
        home = posixpath.normpath(posixpath.join("virtual_lab/docs", posixpath.dirname(page)))
        source[0] = relink(source[0], home, f"{page}.md")


def setup(app: Sphinx) -> dict[str, bool]:
    """Register two steps of the build: write the generated pages, and adapt links.

    The generated pages are written before the build. A link to a file outside the docs is changed
    to a link to the page of this file on the site. The result tells Sphinx that it may process
    pages in parallel.
    """
    app.connect("config-inited", lambda app, _config: _write(app))
    app.connect("source-read", _relink)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
