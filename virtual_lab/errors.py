"""Bad input as an error of one line: file, key, value, and what is allowed."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from importlib import import_module
from typing import Any

VERSION = "0.3.0"
LISTED = "\n  "  # start of a line of a list in an error message
DISTRIBUTION = "virtual-bat-lab"  # name of the package; `virtual-lab` on the index is another one


def _in_python(name: str, value: str) -> str:
    """Return a parameter and its value as an argument of Python."""
    plain = not value or re.fullmatch(r"[-+.\de]+", value)
    return f"{name}={value if plain else repr(value)}"


PARAMETER = re.compile(r"\{([a-z_]+)(?:=([^{}]*))?\}")  # {fps} or {fps=240} in a message
# function that writes a parameter and its value, which may be empty, for the present user
naming: ContextVar[Callable[[str, str], str]] = ContextVar("naming", default=_in_python)


def name_parameters(text: str) -> str:
    """Return a message with each parameter in braces as the present user states it.

    ``{fps=240}`` becomes ``fps=240`` in Python. Where another function is set as `naming`, it
    writes the parameter, for example as ``--fps 240``.
    """
    return PARAMETER.sub(lambda match: naming.get()(match[1], match[2] or ""), text)


class InputError(ValueError):
    """Input that cannot be used. The message is one line that tells the user how to correct it.

    If `allowed` contains `LISTED`, further lines list the places to correct. A parameter in braces,
    in `key` or `allowed`, is written as `name_parameters` writes it.
    """

    def __init__(self, where: str, key: str, value: object, allowed: str) -> None:
        self.where, self.key, self.value, self.allowed = where, key, value, allowed
        parts = [str(where)] if where else []
        name = name_parameters(key).rstrip("=")
        parts.append(f"{name} = {_short(value)}" if value is not None else name)
        super().__init__(f"{': '.join(parts)}; {name_parameters(allowed)}")

    def __reduce__(self) -> tuple[type[InputError], tuple[object, ...]]:
        """Return type and arguments of the error, so that another process can raise it."""
        return type(self), (self.where, self.key, self.value, self.allowed)

    def _render_traceback_(self) -> list[str]:
        """Return the lines that a notebook prints instead of a traceback."""
        return [f"{type(self).__name__}: {self}"]


class IncompleteError(Exception):
    """A result was saved without some of its files. The message is one line."""

    def __init__(self, where: str, missing: list[str]) -> None:
        self.missing = missing
        super().__init__(f"{where} was saved without {'; '.join(missing)}")


@contextmanager
def without_if_it_fails(form: str, missing: list[str]) -> Iterator[None]:
    """Suppress any error in the context, and append a note about it to `missing`.

    The note consists of `form`, the name of the file that is made in the context, and the reason.
    Panics of Typst, which are not derived from `Exception`, are suppressed too. `KeyboardInterrupt`
    and `SystemExit` are re-raised.
    """
    try:
        yield
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as fault:
        kind = "" if isinstance(fault, InputError) else f"{type(fault).__name__}: "
        missing.append(" ".join(f"{form} ({kind}{fault})".split()))


def nearest(name: object, names: Iterable[str]) -> str:
    """Return a question such as ``did you mean r161? `` with up to two similar names.

    `name` is the mistyped name, and `names` are the allowed names. The case of letters is ignored.
    The result is an empty string if no name is similar.
    """
    folded = {each.lower(): each for each in names}
    near = difflib.get_close_matches(str(name).lower(), folded, n=2, cutoff=0.5)
    return f"did you mean {' or '.join(folded[each] for each in near)}? " if near else ""


def of_extra(module: str, name: str, who: str) -> Any:
    """Import and return a module that is installed with the extra `name`.

    An extra is an optional group of packages. `module` is the name of the module. `who` is the
    feature that needs the extra; the error message names it. Raises `InputError` if the extra is
    not installed.
    """
    try:
        return import_module(module)
    except ImportError as fault:
        raise InputError("", f"{who} needs the extra {name!r}", None, with_extra(name)) from fault


def with_extra(name: str) -> str:
    """Return the part of an error message that states how to install an extra.

    The message names the packages of the extra. The extra itself is installed in a clone of the
    repository, because this package is not on a public index. It is not checked that the extra
    exists. If this package runs without being installed, the message names only the extra.
    """
    from importlib.metadata import PackageNotFoundError, requires

    try:
        required = requires(DISTRIBUTION) or []
    except PackageNotFoundError:
        required = []
    of_it = (line.split(";")[0] for line in required if line.endswith(f'extra == "{name}"'))
    packages = [re.split(r"[^\w.-]", line)[0] for line in of_it if DISTRIBUTION not in line]
    by_name = f"pip install {' '.join(packages)}, or " if packages else ""
    return f"{by_name}in a clone: pip install '.[{name}]' or uv run --extra {name} …"


def _short(value: object) -> str:
    try:
        text = repr(value) if isinstance(value, str) else str(value)
    except ValueError:  # Python does not print such a number
        text = "a number of thousands of digits"
    text = " ".join(text.split())
    # the end is kept, because a long path ends in the name of its file
    return text if len(text) <= 60 else f"{text[:28]}...{text[-29:]}"
