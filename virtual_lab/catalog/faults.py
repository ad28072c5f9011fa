"""What ``data/faults`` says of a fault: how it shows, what it does, what was predicted of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Ge, Gt, Le, MinLen

from virtual_lab.catalog.specs import Dimension, Spec

Number = Annotated[float | None, Dimension("number")]


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction(Spec):
    """Written before the fault was ever played: what catches it, or what it leaves in the result.

    A bias is that of the certificate's number against the same laboratory's on a sound day; its
    `_u` is how far the algebra it comes from is to be trusted.
    """

    procedure: str
    caught_by: str = ""  # flags or the verdict INVALID, any of them; empty: nothing does
    efficiency_bias: Number = None
    efficiency_bias_u: Annotated[float | None, Ge(0), Dimension("number")] = None
    metric_bias: Number = None
    metric_bias_u: Annotated[float | None, Ge(0), Dimension("number")] = None

    def __post_init__(self) -> None:
        biases = (self.efficiency_bias, self.metric_bias)
        trusts = (self.efficiency_bias_u, self.metric_bias_u)
        if self.caught_by:
            if any(number is not None for number in (*biases, *trusts)):
                raise ValueError("a fault that is caught leaves no bias: caught_by or both biases")
        elif any(number is None for number in (*biases, *trusts)):
            raise ValueError("needs caught_by, or efficiency_bias and metric_bias each with its _u")


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundBy(Spec):
    """How a fault is found at the bench: what to do there, and the number that decides."""

    actions: Annotated[tuple[str, ...], MinLen(1)]  # of data/bench/actions.toml
    number: str  # in words; a larger one is worse
    reading: str  # in words, that a page shows beside its limit; {} for what differs by the day
    unit: str = ""  # of the reading in print
    beyond: Annotated[float, Gt(0), Dimension("number")]  # which it is the fault
    # standard deviation of the number on sound days, where no certificate gives one
    u: Annotated[float | None, Gt(0), Dimension("number")] = None
    sure: Annotated[float, Gt(0), Le(1), Dimension("number")]  # of it, who sees that
    unless: tuple[str, ...] = ()  # faults that show the same, and more


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultSheet(Spec):
    """One fault in words, what finds it, and what it was predicted to do."""

    name: str
    title: str
    does: str
    onset: str
    cue: str  # what could be seen in the laboratory
    response: str
    missed: str  # what it does to the result if nobody sees it
    excludes: str  # what the evidence rules out
    found_by: FoundBy | None = None  # none: no check at the bench shows it on 99 days of 100
    unfound: str = ""  # why there is none
    predictions: Annotated[tuple[Prediction, ...], MinLen(1)]

    def __post_init__(self) -> None:
        if (self.found_by is None) == (not self.unfound):
            raise ValueError("needs found_by, or unfound: why no check at the bench finds it")
        named = [prediction.procedure for prediction in self.predictions]
        if len(named) != len(set(named)):
            raise ValueError("two predictions for one procedure")
