"""Scatter of the hits in earlier tests of a laboratory, read from their result folders."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from virtual_lab.certificate.chain import read_and_reduce, result_folders
from virtual_lab.errors import InputError
from virtual_lab.records.particulars import Particulars
from virtual_lab.records.session import Session, pack
from virtual_lab.uncertainty.estimate import Estimate, Estimates
from virtual_lab.uncertainty.scatter import HitVariance

FEWEST = 3  # smallest number of earlier tests; two may be one good and one bad day


def kind_of(session: Session) -> dict[str, str]:
    """Return the properties in which tests must agree before their scatter is pooled.

    The keys are ``bat``, ``procedure`` (text of its sheet), ``rig`` (of the impact stage) and
    ``laboratory`` (its name). Raises `KeyError` for a session without an impact stage.
    """
    return {
        "bat": session.bat,
        "procedure": session.procedure_text,
        "rig": session.rigs["impact"],
        "laboratory": session.particulars.laboratory.name,
    }


def earlier_scatter(
    folders: Sequence[Path], kind: Mapping[str, str], today: Session | None = None
) -> dict[str, Estimate]:
    """Return the variance of a single hit, pooled over earlier tests, keyed by result.

    A result is a quantity such as e_A or the metric. Its variance is in the square of its SI unit.
    The mapping is empty without folders.

    Parameters
    ----------
    folders
        Result folders of earlier tests, or folders that contain them.
    kind
        Kind of the current test, as `kind_of` returns it.
    today
        Session of the current test, which must not be among the earlier tests. None if it has no
        records yet.

    Raises
    ------
    InputError
        There are fewer than three tests, a folder has no certificate, a certificate differs from
        the result recomputed from its records, or a test is listed twice, is the current test, is
        of another kind, or is INVALID.
    """
    if not folders:
        return {}
    every = [inner for folder in folders for inner in result_folders(folder)]
    if len(every) < FEWEST:
        allowed = f"allowed: {FEWEST} or more earlier tests; ten are recommended"
        raise InputError("", "history", _count(len(every)), allowed)
    tests: list[dict[str, HitVariance]] = []
    digests = {_digest(today): "these records"} if today else {}
    for folder in every:
        _, certification = read_and_reduce(folder)
        earlier = kind_of(certification.session)
        for key, wanted in kind.items():
            if earlier[key] != wanted:
                which = (
                    "is another" if key == "procedure" else f"is {earlier[key]!r}, not {wanted!r}"
                )
                allowed = f"{which}; allowed: tests of this bat, procedure, rig and laboratory"
                raise InputError(str(folder), key, None, allowed)
        if not certification.variances:
            allowed = "this test is INVALID; allowed: tests with a result"
            raise InputError(str(folder), "history", None, allowed)
        digest = _digest(certification.session)
        if digest in digests:
            allowed = f"is the same test as {digests[digest]}"
            raise InputError(str(folder), "history", None, allowed)
        digests[digest] = str(folder)
        variances = certification.variances.items()
        tests.append({name: HitVariance.of(Estimates.stack([each])) for name, each in variances})
    source = f"{len(tests)} earlier tests"
    return {
        name: HitVariance.pool([test[name] for test in tests]).as_estimates(source).row(0)
        for name in tests[0]
    }


def _digest(session: Session) -> str:
    """Return the digest of the records, independent of the options of their evaluation."""
    plain = replace(session, history={}, uncertainty="first-order", particulars=Particulars())
    return pack(plain).digest


def _count(tests: int) -> str:
    return f"{tests} test" if tests == 1 else f"{tests} tests"
