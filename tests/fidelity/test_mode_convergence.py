"""The error of the default for each bat, and the gain by each remedy."""

from __future__ import annotations

import pytest

from virtual_lab.catalog import names
from virtual_lab.fidelity import mode_convergence

# bats with the shape of another one: Russell's bats come from two templates
TWINS = {f"russell-{number}" for number in (1, 2, 4, 5, 6)}
BATS = [name for name in names("bats") if name not in TWINS]


@pytest.mark.parametrize("bat", BATS)
def test_the_default_is_converged(bat: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mode_convergence, "COUNTS", (8, 20, 30))  # no other is compared
    rows = mode_convergence.convergence([bat])
    errors = {(row["contact"], row["residual"]): row for row in rows}
    default = errors["patch", "with residual"]
    print(f"{bat}: {default['20_modes']:.1e} against 120 modes")
    assert 0 < default["20_modes"] < 3e-4
    assert default["8_modes"] > 4 * default["20_modes"]
    assert errors["patch", "without"]["20_modes"] > 10 * default["20_modes"]
    assert errors["point", "without"]["30_modes"] > errors["patch", "without"]["30_modes"]
