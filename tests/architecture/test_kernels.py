"""Compiled functions: each is in one cache, so two caches hold the same code."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from numba.core.registry import CPUDispatcher

ROOT = Path(__file__).parents[2]
# Functions that tests call, too. They have no fast math, so inlining does not change their results.
CALLED_BY_TESTS = {"find_final_hits", "gain_memory", "fill_gains"}


def kernels() -> dict[str, Any]:
    """Return all compiled functions of the program, by name and module."""
    modules = [
        import_module(".".join(path.relative_to(ROOT).with_suffix("").parts))
        for path in sorted(ROOT.glob("virtual_lab/**/*.py"))
        if "@njit" in path.read_text("utf-8")
    ]
    return {
        f"{module.__name__}.{name}": value
        for module in modules
        for name, value in vars(module).items()
        if isinstance(value, CPUDispatcher) and value.py_func.__module__ == module.__name__
    }


def is_cached(kernel: Any) -> bool:
    return type(kernel._cache).__name__ != "NullCache"


def test_a_function_that_only_kernels_call_has_no_cache() -> None:
    """A caller compiled in a later process would not inline it, and sums would differ."""
    every = kernels()
    inner = {
        callee.py_func.__name__
        for kernel in every.values()
        for name in kernel.py_func.__code__.co_names
        if isinstance(callee := kernel.py_func.__globals__.get(name), CPUDispatcher)
    }
    assert len(every) > 60
    assert {"_step", "pass_gate", "_fill"} <= inner
    cached = {kernel.py_func.__name__ for kernel in every.values() if is_cached(kernel)}
    assert {"collide", "sector_sums"} <= cached
    assert inner & cached == CALLED_BY_TESTS
