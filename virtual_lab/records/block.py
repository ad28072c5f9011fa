"""Sessions of one or many laboratories side by side, the input of a reduction."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from virtual_lab.records import EncoderRecord, Record
from virtual_lab.records.session import Session
from virtual_lab.uncertainty.estimate import Estimate, Estimates


@dataclass(frozen=True, slots=True, kw_only=True)
class SessionBlock:
    """The records and calibrations of laboratories that test by one procedure.

    Records of bench and wall, and the aim marks, hold the rows of one laboratory after another,
    with the same number of rows for each. Records of shots at the bat are in the order of firing,
    and `owner` holds the laboratory of each shot. Raises `ValueError` for encoder counts of several
    laboratories, because one fit of counts is for one bat.
    """

    procedure_text: str
    calibration: Mapping[str, Estimates]  # "stage.instrument.constant", (laboratory,)
    records: Mapping[str, Mapping[str, Record]]  # stage: channel: record
    owner: NDArray[np.intp]  # laboratory of each shot at the bat, (shot,)
    laboratories: int
    bat: str = ""  # name of the bat
    bat_sport: str = ""  # sport for which the bat is marked; "": not known
    ball_sport: str = ""
    bat_construction: str = ""  # "": not known
    # variance of one hit in earlier tests, by the name of the result, (laboratory,)
    history: Mapping[str, Estimates] = field(default_factory=dict)
    # number of boxes of balls that were opened, (laboratory,)
    boxes: NDArray[np.intp] = field(default_factory=lambda: np.ones(1, dtype=np.intp))

    def __post_init__(self) -> None:
        if self.counted and self.laboratories > 1:
            raise ValueError("counts of an encoder are reduced one laboratory at a time")

    @classmethod
    def of(cls, session: Session) -> Self:
        """Return the block of one session."""
        log = session.records.get("impact", {}).get("log")
        return cls(
            procedure_text=session.procedure_text,
            calibration=_stack(session.calibration),
            history=_stack(session.history),
            records=session.records,
            owner=np.zeros(log.sizes().get("shot", 0) if log else 0, dtype=np.intp),
            laboratories=1,
            bat=session.bat,
            bat_sport=session.bat_sport,
            ball_sport=session.ball_sport,
            bat_construction=session.bat_construction,
            boxes=np.array([session.boxes]),
        )

    @property
    def impact(self) -> Mapping[str, Record]:
        """The records of the shots at the bat, by channel; {} before the first."""
        return self.records.get("impact", {})

    @property
    def counted(self) -> bool:
        """Whether the records contain encoder counts, which are fitted for all shots together."""
        return any(isinstance(each, EncoderRecord) for each in self.impact.values())

    def row(self, laboratory: int) -> SessionBlock:
        """Return one laboratory of the block as a block of one."""
        if self.laboratories == 1:
            return self  # with its large arrays, which `select` would drop
        mask = self.owner == laboratory

        def constants_of_one(estimates: Mapping[str, Estimates]) -> dict[str, Estimates]:
            first = slice(laboratory, laboratory + 1)
            return {name: each.select(first) for name, each in estimates.items()}

        def select_laboratory(stage: str, record: Record) -> Record:
            if stage == "impact" and "shot" in record.sizes():
                return record.select(mask)
            row_count = next(iter(record.sizes().values())) // self.laboratories
            return record.select(slice(laboratory * row_count, (laboratory + 1) * row_count))

        return replace(
            self,
            calibration=constants_of_one(self.calibration),
            history=constants_of_one(self.history),
            records={
                stage: {
                    channel: select_laboratory(stage, record) for channel, record in records.items()
                }
                for stage, records in self.records.items()
            },
            owner=np.zeros(int(mask.sum()), dtype=np.intp),
            boxes=self.boxes[laboratory : laboratory + 1],
            laboratories=1,
        )

    def constants_of(self, laboratory: int) -> Mapping[str, Estimate]:
        """Return the calibration constants of one laboratory keyed by name."""
        return _LaboratoryConstants(self.calibration, laboratory)


def _stack(estimates: Mapping[str, Estimate]) -> dict[str, Estimates]:
    return {name: Estimates.stack([each]) for name, each in estimates.items()}


@dataclass(frozen=True, slots=True)
class _LaboratoryConstants(Mapping[str, Estimate]):
    """The estimates of one laboratory, keyed by name. Each is made when it is requested."""

    block: Mapping[str, Estimates]
    laboratory: int

    def __getitem__(self, name: str) -> Estimate:
        return self.block[name].row(self.laboratory)

    def __iter__(self) -> Iterator[str]:
        return iter(self.block)

    def __len__(self) -> int:
        return len(self.block)

    def __contains__(self, name: object) -> bool:
        return name in self.block
