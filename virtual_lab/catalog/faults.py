"""Sheets of ``data/faults``: signs of a fault, its effect, and its prediction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le, MinLen

from virtual_lab.catalog.specs import Dimension, Spec

Number = Annotated[float | None, Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction(Spec):
    """Prediction made before the first simulation of a fault: its detection, or its bias.

    A bias is the difference between the results of the same laboratory with and without the fault.
    Its `_u` is the uncertainty of the estimate.
    """

    procedure: str
    caught_by: str = ""  # flags, or the verdict INVALID, any of which detects it; empty if none
    efficiency_bias: Number = None
    efficiency_bias_u: Annotated[float | None, Ge(0), Dimension("number")] = None
    metric_bias: Number = None
    metric_bias_u: Annotated[float | None, Ge(0), Dimension("number")] = None

    def __post_init__(self) -> None:
        biases = (self.efficiency_bias, self.metric_bias)
        trusts = (self.efficiency_bias_u, self.metric_bias_u)
        if self.caught_by:
            if any(number is not None for number in (*biases, *trusts)):
                raise ValueError(
                    "a detected fault leaves no bias: give either caught_by or both biases"
                )
        elif any(number is None for number in (*biases, *trusts)):
            raise ValueError("needs caught_by, or efficiency_bias and metric_bias each with its _u")


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundBy(Spec):
    """Detection of a fault at the rehearsal bench: the actions, and the deciding number."""

    actions: Annotated[tuple[str, ...], MinLen(1)]  # names of actions in data/bench/actions.toml
    number: str  # description of the deciding number, which is larger for a worse fault
    reading: str  # name of the reading on the page; {} marks parts that differ from day to day
    unit: str = ""  # unit of the printed reading
    beyond: Annotated[float, Gt(0), Dimension("number")]  # limit above which the fault is suspected
    # standard deviation of the number on sound days, if no certificate gives one
    u: Annotated[float | None, Gt(0), Dimension("number")] = None
    # probability of the fault above that limit
    sure: Annotated[float, Gt(0), Le(1), Dimension("number")]
    unless: tuple[str, ...] = ()  # faults with the same signs and others


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultSheet(Spec):
    """Sheet of one fault: description, detection and predictions."""

    name: str
    title: str
    does: str
    onset: str
    cue: str  # visible sign in the laboratory
    response: str
    missed: str  # effect on the result if it is not detected
    excludes: str  # explanations that the evidence rules out
    found_by: FoundBy | None = None  # None if no check detects it on 99 of 100 days
    unfound: str = ""  # reason why there is no check
    predictions: Annotated[tuple[Prediction, ...], MinLen(1)]

    def __post_init__(self) -> None:
        if (self.found_by is None) == (not self.unfound):
            raise ValueError(
                "needs found_by, or unfound: the reason why no check at the bench finds the fault"
            )
        named = [prediction.procedure for prediction in self.predictions]
        if len(named) != len(set(named)):
            raise ValueError("two predictions for one procedure")
