"""Earlier tests of a laboratory, from their result folders: how much their hits scattered."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from virtual_lab.certificate.chain import result_folders, stated_and_reduced
from virtual_lab.errors import InputError
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.estimate import Estimate, Known
from virtual_lab.uncertainty.scatter import HitVariance

FEWEST = 3  # tests: two know no more than a good day and a bad one


def kind_of(session: Session) -> dict[str, str]:
    """Return the bat, procedure, rig and laboratory that joined tests must have in common."""
    return {
        "bat": session.bat,
        "procedure": session.procedure_text,
        "rig": session.rigs["impact"],
        "laboratory": session.particulars.laboratory.name,
    }


def earlier_scatter(folders: Sequence[Path], asked: Mapping[str, str]) -> dict[str, Estimate]:
    """Return the variance of a hit in each result, by the certificates of earlier tests.

    `folders` are result folders, or folders of such. `asked` is what `kind_of` says of today's.

    Raises
    ------
    InputError
        Fewer than three, one that stands twice or is of another kind, INVALID, or no certificate.
    """
    if not folders:
        return {}
    every = [inner for folder in folders for inner in result_folders(folder)]
    if len(every) < FEWEST:
        allowed = f"allowed: {FEWEST} earlier tests and more; ten serve well"
        raise InputError("", "history", _count(len(every)), allowed)
    tests: list[dict[str, HitVariance]] = []
    seen: dict[str | None, Path] = {}
    for folder in every:
        document, found = stated_and_reduced(folder)
        for key, there in kind_of(found.session).items():
            if there != asked[key]:
                which = "is another" if key == "procedure" else f"is {there!r}, not {asked[key]!r}"
                allowed = f"{which}; allowed: tests of this bat, procedure, rig and laboratory"
                raise InputError(str(folder), key, None, allowed)
        if not found.variances:
            allowed = "an INVALID test tells nothing; allowed: one with a result"
            raise InputError(str(folder), "history", None, allowed)
        first = seen.setdefault(document.session_digest, folder)
        if first is not folder:
            raise InputError(str(folder), "history", None, f"is the test of {first} once more")
        own = found.variances.items()
        tests.append({name: HitVariance.of(Known.stacked([each])) for name, each in own})
    source = f"{len(tests)} earlier tests"
    return {
        name: HitVariance.pooled([test[name] for test in tests]).known(source).of(0)
        for name in tests[0]
    }


def _count(tests: int) -> str:
    return f"{tests} test" if tests == 1 else f"{tests} tests"
