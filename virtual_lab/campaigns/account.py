"""A campaign's parts by their state (made, made again, missing), in words and as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

INCOMPLETE = 4  # exit code of the program


@dataclass(frozen=True, slots=True, kw_only=True)
class Account:
    """The state of the parts of a campaign; a part is named by its tests."""

    parts: int
    tests: int  # number of tests in the parts
    made: int = 0  # number of parts made by this run
    again: Mapping[str, str] = field(default_factory=dict)  # faults of parts made again
    missing: Mapping[str, str] = field(default_factory=dict)  # reasons for missing parts
    processors: tuple[str, ...] = ()  # families of the processors that made the parts

    @property
    def code(self) -> int:
        """The program's exit code."""
        return INCOMPLETE if self.missing else 0

    @property
    def document(self) -> dict[str, Any]:
        """The account for JSON."""
        return asdict(self)

    @property
    def text(self) -> str:
        """The account for a terminal."""
        there = self.parts - len(self.missing)
        lines = [f"{there} of {self.parts} parts are there, {self.made} of them made now"]
        lines += [f"made again, {why}: {name}" for name, why in self.again.items()]
        lines += [f"missing, {why}: {name}" for name, why in self.missing.items()]
        if len(self.processors) > 1:
            lines.append(f"equal to 1e-9, no more, by processors: {', '.join(self.processors)}")
        return "\n".join(lines)
