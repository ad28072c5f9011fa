"""The general help: commands in sections by purpose."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import click

HELP_WIDTH = 1000  # longest first sentence in a list of commands [characters], never exceeded


class Sections(click.Group):
    """A group whose help lists its commands in sections by purpose.

    `others` returns all commands of other packages, or the one with a given name. It takes as long
    as a short command, so it is called only for the help and for a name that is not in the
    sections.
    """

    def __init__(
        self,
        *,
        sections: Mapping[str, Sequence[click.Command]],
        others: Callable[..., Sequence[click.Command]],
        **more: Any,
    ) -> None:
        super().__init__(**more)
        self.sections, self.others = sections, others
        for commands in sections.values():
            for each in commands:
                self.add_command(each)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return a command by its name, including the commands of other packages."""
        return self.commands.get(cmd_name) or next(iter(self.others(cmd_name)), None)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write one table of commands per section."""
        others = self.others()
        sections = {**self.sections, **({"From other packages": others} if others else {})}
        widest = max(len(str(each.name)) for commands in sections.values() for each in commands)
        for title, commands in sections.items():
            with formatter.section(title):
                rows = [(str(each.name), each.get_short_help_str(HELP_WIDTH)) for each in commands]
                formatter.write_dl([(name.ljust(widest), words) for name, words in rows])
