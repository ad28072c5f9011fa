"""State of the parts of a campaign: numbers of parts made, made again and missing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

INCOMPLETE = 4  # exit code of the program


@dataclass(frozen=True, slots=True, kw_only=True)
class Account:
    """State of the parts of a campaign. Parts are named by a description of their tests."""

    parts: int
    tests: int  # number of tests in the parts
    made: int = 0  # number of parts made by this run
    again: Mapping[str, str] = field(default_factory=dict)  # faults of parts made again
    missing: Mapping[str, str] = field(default_factory=dict)  # reasons for missing parts
    processors: tuple[str, ...] = ()  # families of the processors that made the parts

    @property
    def code(self) -> int:
        """Exit code of the program: 0 if no part is missing."""
        return INCOMPLETE if self.missing else 0

    @property
    def document(self) -> dict[str, Any]:
        """The account as a JSON object."""
        return asdict(self)

    @property
    def text(self) -> str:
        """The account as text."""
        present = self.parts - len(self.missing)
        lines = [f"{present} of {self.parts} parts exist, of which this run made {self.made}"]
        lines += [f"made again, {why}: {name}" for name, why in self.again.items()]
        lines += [f"missing, {why}: {name}" for name, why in self.missing.items()]
        if len(self.processors) > 1:
            kinds = ", ".join(self.processors)
            lines.append(f"several kinds of processors, whose results agree to 1e-9: {kinds}")
        return "\n".join(lines)
