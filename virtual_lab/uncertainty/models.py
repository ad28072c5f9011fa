"""A user's function as a model: called with rows of inputs at once, or row by row.

Every answer is a mapping of names to columns (k,); a model with one output has the name `RESULT`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.uncertainty.inputs import Inputs
from virtual_lab.units import Array

RESULT = "result"
ONE = "allowed: one number, or a mapping of names to numbers"
Outputs = dict[str, Array]


@dataclass(frozen=True, slots=True)
class Model:
    """A function of named inputs that has been tried."""

    function: Callable[..., Any]
    inputs: Inputs
    row_by_row: bool
    outputs: tuple[str, ...] = ()

    @classmethod
    def tried(cls, function: Callable[..., Any], inputs: Inputs) -> Model:
        """Return the model, called row by row where it does not take rows at once.

        Three rows about the estimates are tried at once and each alone: a function that mixes rows
        or takes numbers only shows it.
        """
        columns = {
            name: source.estimate.value + source.estimate.u * np.array([0.0, 0.3, -0.2])
            for name, source in inputs.sources.items()
        }
        at_once, alone = cls(function, inputs, False), cls(function, inputs, True)
        try:
            together = at_once(columns)
            one_each = [
                at_once({name: column[k : k + 1] for name, column in columns.items()})
                for k in range(3)
            ]
            whole = all(
                np.allclose(values, np.concatenate([each[name] for each in one_each]), 1e-9, 0)
                for name, values in together.items()
            )
        except InputError as fault:
            if fault.key in ("inputs changed", "value"):
                raise
            whole = False
        chosen = at_once if whole else alone
        names = together if whole else alone(columns)
        return cls(function, inputs, chosen.row_by_row, tuple(names))

    def __call__(self, columns: Mapping[str, Array]) -> Outputs:
        """Return the outputs for columns (k,) of the sources; `InputError` for a wrong answer."""
        arguments = self.inputs.arguments(columns)
        k = next(iter(arguments.values())).shape[0]
        for values in arguments.values():
            values.flags.writeable = False
        if self.row_by_row:
            rows = [
                self._answer({name: values[row] for name, values in arguments.items()}, ())
                for row in range(k)
            ]
            found = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        else:
            found = self._answer(arguments, (k,))
        for name, values in found.items():
            wrong = ~np.isfinite(values)
            if wrong.any():
                row = int(np.argmax(wrong))
                where = _where({key: value[row] for key, value in arguments.items()})
                said = f"is {values[row]} in {wrong.sum()} of {k} rows, as at {where}"
                raise InputError("model", "value", name, f"{said}; allowed: finite numbers")
        return found

    def _answer(self, arguments: Mapping[str, Any], shape: tuple[int, ...]) -> Outputs:
        try:
            with np.errstate(all="ignore"):
                given = self.function(**arguments)
        except Exception as fault:
            if "read-only" in str(fault):
                allowed = "the model writes into an array it was given; allowed: a new array"
                raise InputError("model", "inputs changed", None, allowed) from fault
            said = f"{type(fault).__name__}: {fault}; at {_where(arguments)}"
            raise InputError("model", "raises", None, " ".join(said.split())) from fault
        named = given if isinstance(given, Mapping) else {RESULT: given}
        if not named or (self.outputs and tuple(named) != self.outputs):
            allowed = f"allowed: {', '.join(self.outputs)}" if self.outputs else ONE
            raise InputError("model", "outputs", list(named), allowed)
        return {name: self._numbers(name, values, shape) for name, values in named.items()}

    def _numbers(self, name: str, given: Any, shape: tuple[int, ...]) -> Array:
        try:
            values = np.asarray(given)
        except ValueError as fault:
            raise InputError("model", name, given, ONE) from fault
        if values.dtype.kind not in "fiub":
            raise InputError("model", name, given, f"{ONE}, real ones")
        if values.shape != shape:
            raise InputError("model", name, f"shape {values.shape}", ONE)
        return np.asarray(values, float)


def _where(arguments: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name} = {values:.6g}" if np.ndim(values) == 0 else f"{name} of shape {np.shape(values)}"
        for name, values in arguments.items()
    )
