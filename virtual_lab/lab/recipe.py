"""The recipe of a test: all choices from which the same test can be played again."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, replace
from operator import attrgetter
from typing import Any, Self

import numpy as np

from virtual_lab import catalog
from virtual_lab.catalog.specs import Spec, Whole, YesNo
from virtual_lab.catalog.validation import validate
from virtual_lab.lab.laboratory import Laboratory
from virtual_lab.lab.setup import TestSetup
from virtual_lab.parameters import Propagation
from virtual_lab.records.session import ConstantEntry, entry_of_constant
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.stations.rig import MotionModel, Reality
from virtual_lab.uncertainty.estimate import Estimate, Estimates


@dataclass(frozen=True, slots=True, kw_only=True)
class Recipe(Spec):
    """The choices for the test of one laboratory, as its sealed truth states them.

    The fields are those of `TestSetup`, with the name of a sheet in place of its content.
    """

    seed: int
    number: Whole
    faults: tuple[str, ...]
    bat: str
    procedure: str
    control_bat: str | None
    rig: str
    reality: Reality
    collision_model: str | None
    motion: MotionModel
    detail: RecordDetail
    test: Whole | None
    lot: Whole | None
    random_bat: YesNo
    uncertainty: Propagation
    common_model: YesNo  # whether the laboratories of a study share one collision model
    history: Mapping[str, ConstantEntry]
    # text of each sheet that is not in the catalog or differs from it, keyed by ``kind/name``
    sheets: Mapping[str, str]
    is_control: YesNo = False  # whether the test is that of the control bat

    @classmethod
    def of(cls, laboratory: Laboratory, index: int) -> Self:
        """Return the recipe of the test in laboratory `index` of a block."""
        setup = laboratory.setup
        control = setup.control_bat
        return cls(
            seed=laboratory.seed,
            number=int(np.broadcast_to(setup.number, setup.count)[index]),
            faults=setup.faults.names,
            bat=setup.bat.spec.name,
            procedure=setup.rules.spec.name,
            control_bat=control.spec.name if control else None,
            common_model=setup.collision is not None,
            history={
                name: ConstantEntry(**entry_of_constant(each.row(index)))
                for name, each in setup.history.items()
            },
            sheets=_changed_sheets(laboratory),
            **{name: getattr(setup, name) for name in _copied_fields()},
        )

    @classmethod
    def read(cls, truth: Mapping[str, Any], where: str) -> Self:
        """Return the recipe in a sealed truth. Raises `InputError`, which names `where`."""
        return validate(truth.get("recipe") or {}, where, cls)

    def as_json(self) -> dict[str, Any]:
        """Return the recipe as values of JSON."""
        document: dict[str, Any] = json.loads(json.dumps(asdict(self), default=attrgetter("value")))
        return document

    def setup(self) -> TestSetup:
        """Return the setup of the test, except for a common collision model.

        It must be called while `sheets` are in place. Raises `InputError` in the same cases as
        `TestSetup.of`.
        """
        setup = TestSetup.of(
            self.bat,
            procedure=self.procedure,
            rig=self.rig,
            seed=self.seed,
            number=self.number,
            faults=self.faults,
            control_bat=self.control_bat,
        )
        history = {
            name: Estimates.stack([Estimate(**asdict(each))]) for name, each in self.history.items()
        }
        return replace(
            setup, history=history, **{name: getattr(self, name) for name in _copied_fields()}
        )


def _copied_fields() -> set[str]:
    """Return the names of the fields that a recipe and a setup hold in the same form."""
    recipe, setup = ({each.name for each in fields(kind)} for kind in (Recipe, TestSetup))
    return recipe & setup - {"seed", "number", "faults", "bat", "control_bat", "history"}


def _changed_sheets(laboratory: Laboratory) -> dict[str, str]:
    """Return the text of each sheet of a test that the catalog does not have."""
    texts = {key: entry.text for key, entry in laboratory.setup.sheets.items()}
    others = laboratory.sheets.items()
    texts |= {key: text for key, text in others if key[0] in ("rigs", "instruments")}
    changed = (key for key, text in texts.items() if not catalog.is_shipped(*key, text))
    return {"/".join(key): texts[key] for key in changed}
