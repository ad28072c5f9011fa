"""Sheets of the catalog by name: `bat`, `ball`, `procedure`, `instrument` and `rig`."""

from __future__ import annotations

from virtual_lab.sheets import AnyName, Sheet


def bat(name: AnyName) -> Sheet:
    """Return the data sheet of a bat. Its method `with_` returns a copy with changed values.

    Parameters
    ----------
    name
        A name in the catalog (``vl.shelf("bats")``), or the path of a .toml file.

    Raises
    ------
    InputError
        The name is unknown, or the file is not the sheet of a bat.
    """
    return Sheet.of("bats", name)


def ball(name: AnyName) -> Sheet:
    """Return the data sheet of a ball. Its method `with_` returns a copy with changed values.

    Parameters
    ----------
    name
        A name in the catalog (``vl.shelf("balls")``), or the path of a .toml file.

    Raises
    ------
    InputError
        The name is unknown, or the file is not the sheet of a ball.
    """
    return Sheet.of("balls", name)


def procedure(name: AnyName) -> Sheet:
    """Return the data sheet of a procedure. Its method `with_` returns a copy with changed values.

    Parameters
    ----------
    name
        A name in the catalog (``vl.shelf("procedures")``), or the path of a .toml file.

    Raises
    ------
    InputError
        The name is unknown, or the file is not the sheet of a test procedure.
    """
    return Sheet.of("procedures", name)


def instrument(name: AnyName) -> Sheet:
    """Return the data sheet of an instrument. Its method `with_` returns a changed copy.

    Parameters
    ----------
    name
        A name in the catalog (``vl.shelf("instruments")``), or the path of a .toml file.

    Raises
    ------
    InputError
        The name is unknown, or the file is not the sheet of an instrument.
    """
    return Sheet.of("instruments", name)


def rig(name: AnyName) -> Sheet:
    """Return the data sheet of a rig. Its method `with_` returns a copy with changed values.

    Parameters
    ----------
    name
        A name in the catalog (``vl.shelf("rigs")``), or the path of a .toml file.

    Raises
    ------
    InputError
        The name is unknown, or the file is not the sheet of a rig.
    """
    return Sheet.of("rigs", name)
