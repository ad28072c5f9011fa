"""Names of parameters in messages, in the form of the user's interface."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from virtual_lab.errors import naming


def shell_name(name: str, value: str = "") -> str:
    """Return a parameter and its value as an option of the command line."""
    return f"--{name.replace('_', '-')} {value}".strip()


@contextmanager
def parameters_named(write: Callable[[str, str], str]) -> Iterator[None]:
    """Let messages name parameters by the function `write` until the context ends.

    `write` takes the name of a parameter and a value, which may be empty.
    """
    token = naming.set(write)
    try:
        yield
    finally:
        naming.reset(token)
