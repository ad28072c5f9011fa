"""The function that numba is compiling, which the progress line of a first run names."""

from __future__ import annotations

from typing import Any

from numba.core import event


class CompiledFunctions(event.Listener):
    """Names of the functions being compiled: the called one, then the functions that it calls."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def on_start(self, event: Any) -> None:
        """Add the function whose compilation starts."""
        self.names.append(event.data["dispatcher"].py_func.__name__)

    def on_end(self, event: Any) -> None:
        """Remove the function whose compilation ends."""
        del self.names[-1:]


COMPILED = CompiledFunctions()
event.register("numba:compile", COMPILED)  # type: ignore[no-untyped-call]
