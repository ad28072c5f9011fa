"""Tables of a certification: one row per shot, one row per uncertainty component."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from virtual_lab.certificate.columns import shot_columns
from virtual_lab.certificate.filling import budget_lines
from virtual_lab.certificate.printed import printed_source
from virtual_lab.files.column_units import unit_of
from virtual_lab.files.dictionary import with_units
from virtual_lab.measurement.certification import Certification
from virtual_lab.uncertainty.budget import Budget

if TYPE_CHECKING:
    import pandas as pd


def shots_as_columns(certification: Certification) -> dict[str, ArrayLike]:
    """Return instrument readings and reduced results, keyed by column name, each of shape (shot,).

    A name ends in its unit. Columns of instruments that the rig does not have are left out.
    """
    columns = {
        name: column.values(certification)
        for name, column in shot_columns(certification.procedure.metric).items()
    }
    return {name: values for name, values in columns.items() if values is not None}


def shot_units(columns: Mapping[str, ArrayLike]) -> dict[str, str]:
    """Return the units of the columns of `shots_as_columns`, keyed by name.

    The unit is "1" for pure numbers, and empty for strings, booleans and integers.
    """
    kinds = {name: np.asarray(values).dtype.kind for name, values in columns.items()}
    return {name: unit_of(name).text if kind == "f" else "" for name, kind in kinds.items()}


def budget_table(budget: Budget) -> pd.DataFrame:
    """Return the uncertainty budget as a table with values in SI units.

    It has one row per component, sorted by contribution, the largest first. The columns are the
    words of the certificate for the component, `source`, and the fields of `BudgetLine`.
    """
    import pandas as pd

    lines = [
        {"source": printed_source(line.component, line.u)["words"], **asdict(line)}
        for line in budget_lines(budget)
    ]
    return with_units(pd.DataFrame(lines))
