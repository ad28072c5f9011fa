"""What a data sheet may say of a ball."""

from __future__ import annotations

import pytest

from virtual_lab import catalog
from virtual_lab.catalog.specs import BallSpec
from virtual_lab.errors import InputError


def sheet(*changes: tuple[str, str, str]) -> str:
    """Return a ball's sheet with other numbers in it: key, old and new."""
    text = catalog.text("balls", "game-2003")
    for key, old, new in changes:
        line = f"{key} = {{ value = {old},"
        assert line in text
        text = text.replace(line, f"{key} = {{ value = {new},")
    return text


@pytest.mark.parametrize(
    ("key", "old", "new", "said"),
    [
        ("value", "0.50", "0.007", r"restitution\.value = .*0\.05"),
        ("floor", "0.50", "0.003", r"restitution\.floor = .*0\.05"),
        ("exponent", "1", "9", r"exponent = .* 3"),
        ("stiffness", "3.5e6", "1e14", r"stiffness of 1e\+14 N/m\^a, allowed: 10000 to 1e\+09"),
        ("stiffness", "3.5e6", "1e2", r"stiffness of 100 N/m\^a, allowed: 10000 to 1e\+09"),
    ],
)
def test_balls_of_no_sport_are_refused(key: str, old: str, new: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        catalog.read(sheet((key, old, new)), "own.toml", BallSpec)


def test_what_stiffness_may_be_goes_with_the_exponent() -> None:
    """The same force at a centimetre: 3.5e10 N/m^3 is as firm as 3.5e6 N/m."""
    stiff = ("stiffness", "3.5e6", "3.5e10")
    with pytest.raises(InputError, match=r"exponent of 1$"):
        catalog.read(sheet(stiff), "own.toml", BallSpec)
    cubic = ("exponent", "1", "3")
    assert catalog.read(sheet(stiff, cubic), "own.toml", BallSpec).spec.exponent == 3
