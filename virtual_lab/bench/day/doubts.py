"""The faults of the catalog that a trainee can name, keyed by name and by title."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from types import MappingProxyType

from virtual_lab import catalog
from virtual_lab.catalog.faults import FaultSheet
from virtual_lab.catalog.specs import is_line
from virtual_lab.errors import InputError, nearest

LONGEST_TEXT = 300  # largest number of characters of a trainee's own words


@cache
def fault_sheets() -> Mapping[str, FaultSheet]:
    """Return the data sheets of all faults in the catalog, keyed by name."""
    return MappingProxyType(
        {name: catalog.load("faults", name, FaultSheet).spec for name in catalog.names("faults")}
    )


def fault_titles() -> dict[str, str]:
    """Return the title of each fault of the catalog, by the name of the fault."""
    return {name: sheet.title for name, sheet in fault_sheets().items()}


def fault_of_text(words: str, action: str, key: str) -> str:
    """Return the name of the fault that a trainee entered by its title or its name.

    Three kinds of input are returned unchanged:

    * “none”;
    * “no result”;
    * a line of at most 300 characters that begins with “other:” and describes a fault.

    Parameters
    ----------
    words
        Text that the trainee entered.
    action, key
        Names of the action and of the input field, for the error message.

    Raises
    ------
    InputError
        `words` is neither a fault nor one of these inputs. The message suggests the most similar
        title.
    """
    titles = fault_titles()
    names = {title.lower(): name for name, title in titles.items()}
    if words in {*titles, "none", "no result"}:
        return words
    if words.lower() in names:
        return names[words.lower()]
    if words.lower().startswith("other:") and is_line(words, LONGEST_TEXT):
        return words
    suggestion = nearest(words, titles.values())
    allowed = f"{suggestion}allowed: a fault from the list, none, or your own words after “other:”"
    raise InputError(action, key, words, allowed)
