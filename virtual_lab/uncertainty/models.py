"""A user's function as a model, called with many rows of inputs at once or row by row.

The result of a call is a mapping of names to columns (k,). The output of a model with only one
output is named `RESULT`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from virtual_lab.errors import InputError
from virtual_lab.uncertainty.inputs import LARGEST, Inputs
from virtual_lab.units import Array

RESULT = "result"
ONE = "allowed: one number, or a mapping of names to numbers"
CHANGED, VALUE, REPEATED = "inputs changed", "value", "output"  # keys of errors
SAME = 1e-9  # largest relative difference of two results that are the same
Outputs = dict[str, Array]


@dataclass(frozen=True, slots=True)
class Model:
    """A function of named inputs that gave valid results for a few rows of inputs."""

    function: Callable[..., Any]
    inputs: Inputs
    row_by_row: bool
    outputs: tuple[str, ...] = ()  # (): any
    trial: Mapping[str, Array] = field(default_factory=dict)  # three rows of the sources
    trial_outputs: Mapping[str, Array] = field(default_factory=dict)

    @classmethod
    def try_out(cls, function: Callable[..., Any], inputs: Inputs) -> Model:
        """Return the model, called row by row if the function does not accept several rows.

        The function is called with three rows of inputs near the estimates, first together and then
        one by one. This reveals a function that mixes rows or accepts only numbers. Both calls are
        repeated, as in `require_same`.
        """
        columns = {
            name: source.estimate.value + source.estimate.u * np.array([0.0, 0.3, -0.2])
            for name, source in inputs.sources.items()
        }
        try:
            whole = cls(function, inputs, row_by_row=False)._fix_outputs(columns)
            whole.require_same()
            one_each = [
                whole({name: column[k : k + 1] for name, column in columns.items()})
                for k in range(3)
            ]
        except InputError as fault:
            if fault.key in (CHANGED, VALUE, REPEATED):
                raise
        else:
            if all(
                _same(values, np.concatenate([each[name] for each in one_each]))
                for name, values in whole.trial_outputs.items()
            ):
                return whole
        alone = cls(function, inputs, row_by_row=True)._fix_outputs(columns)
        alone.require_same()
        return alone

    def _fix_outputs(self, columns: Mapping[str, Array]) -> Model:
        """Return the model with the names and values of its outputs for the given rows."""
        answers = self(columns)
        return replace(self, outputs=tuple(answers), trial=columns, trial_outputs=answers)

    def require_same(self) -> None:
        """Raise `InputError` if the function gives other results for the rows that were tried.

        This check is made before and after a propagation, because a function may draw random
        numbers, count its calls, or depend on something that changes.
        """
        again = self(self.trial)
        for name, values in self.trial_outputs.items():
            differs = ~np.isclose(values, again[name], SAME, 0)
            if differs.any():
                row = int(np.argmax(differs))
                pair = f"{values[row]:.9g} and {again[name][row]:.9g}"
                allowed = f"the same inputs gave two results, {pair}; the model must depend on the "
                raise InputError("model", REPEATED, name, f"{allowed}inputs alone")

    def __call__(self, columns: Mapping[str, Array]) -> Outputs:
        """Return the outputs for columns (k,) of the sources.

        Raises `InputError` if the function returns something else than allowed.
        """
        arguments = self.inputs.arguments(columns)
        k = next(iter(arguments.values())).shape[0]
        for values in arguments.values():
            values.flags.writeable = False
        if self.row_by_row:
            rows = [
                self._answer({name: values[row] for name, values in arguments.items()}, ())
                for row in range(k)
            ]
            for row in rows:
                self._require_names(row, tuple(rows[0]))
            outputs = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        else:
            outputs = self._answer(arguments, (k,))
        for name, values in outputs.items():
            wrong = ~(np.abs(values) < LARGEST)
            if wrong.any():
                at = int(np.argmax(wrong))
                where = _where({key: value[at] for key, value in arguments.items()})
                message = f"is {values[at]} in {wrong.sum()} of {k} rows, for example at {where}"
                allowed = f"{message}; allowed: numbers with magnitudes below {LARGEST:g}"
                raise InputError("model", VALUE, name, allowed)
        return outputs

    def _answer(self, arguments: Mapping[str, Any], shape: tuple[int, ...]) -> Outputs:
        try:
            with np.errstate(all="ignore"):
                answer = self.function(**arguments)
        except Exception as fault:
            if "read-only" in str(fault):
                allowed = "the model changes one of its input arrays; it must make a new array"
                raise InputError("model", CHANGED, None, allowed) from fault
            message = f"{type(fault).__name__}: {fault}; at {_where(arguments)}"
            raise InputError("model", "raises", None, " ".join(message.split())) from fault
        named = answer if isinstance(answer, Mapping) else {RESULT: answer}
        if not named:
            raise InputError("model", "outputs", [], ONE)
        names = self.outputs or tuple(named)
        self._require_names(named, names)
        return {name: self._numbers(name, named[name], shape) for name in names}

    def _require_names(self, answer: Mapping[str, Any], names: tuple[str, ...]) -> None:
        if set(answer) != set(names):
            allowed = f"allowed: {', '.join(map(str, names))}, the outputs of the first call"
            raise InputError("model", "outputs", list(answer), allowed)

    def _numbers(self, name: str, answer: Any, shape: tuple[int, ...]) -> Array:
        try:
            values = np.asarray(answer)
        except ValueError as fault:
            raise InputError("model", name, answer, ONE) from fault
        if values.dtype.kind not in "fiub":
            raise InputError("model", name, answer, f"{ONE}, real ones")
        if values.shape != shape:
            raise InputError("model", name, f"shape {values.shape}", ONE)
        return np.asarray(values, float)


def _same(a: Array, b: Array) -> bool:
    return bool(np.allclose(a, b, SAME, 0))


def _where(arguments: Mapping[str, Any]) -> str:
    return ", ".join(
        f"{name} = {values:.6g}" if np.ndim(values) == 0 else f"{name} of shape {np.shape(values)}"
        for name, values in arguments.items()
    )
