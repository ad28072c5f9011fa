"""A message names a parameter as the user of the door would state it."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import pytest

import virtual_lab as vl
from tests.cli.test_cli import Run, run  # noqa: F401 its fixture
from virtual_lab.commands.wording import parameters_named, shell_name
from virtual_lab.errors import InputError, name_parameters

ADVICE = "give {fps=240}, {ball_at=X,Y@FRAME} or {global_shutter}; not {'a': 1} and {Upper}"


def test_the_same_message_in_python_and_at_the_shell() -> None:
    in_python = "give fps=240, ball_at='X,Y@FRAME' or global_shutter=; not {'a': 1} and {Upper}"
    at_shell = "give --fps 240, --ball-at X,Y@FRAME or --global-shutter; not {'a': 1} and {Upper}"
    assert name_parameters(ADVICE) == in_python
    fault = InputError("clip.mp4", "{readout}", "8ms", ADVICE)
    assert str(fault) == f"clip.mp4: readout = '8ms'; {in_python}"
    with parameters_named(shell_name):
        assert name_parameters(ADVICE) == at_shell
        copied = pickle.loads(pickle.dumps(fault))  # as from another process
    assert str(copied) == f"clip.mp4: --readout = '8ms'; {at_shell}"
    assert name_parameters(ADVICE) == in_python


def test_an_error_of_a_function_speaks_the_language_of_its_caller(
    run: Run,  # noqa: F811
    tmp_path: Path,
) -> None:
    with pytest.raises(InputError, match=r"^ball = '73'; expected a length"):
        vl.track("clip.mp4", ball="73")
    code, _, err = run("track", "clip.mp4", "--ball", "73")
    assert (code, err.startswith("virtual-lab: --ball = '73'; expected a length")) == (2, True)
    code, _, err = run("rehearse", "--operator", "book", "--script", "x.json")
    assert "--operator, --script and --replay exclude each other" in err
    with pytest.raises(InputError, match=r"^ball = '73'"):  # the shell's words end with its call
        vl.track("clip.mp4", ball="73")


def test_a_result_names_parameters_as_its_reader_states_them(
    run: Run,  # noqa: F811
    tmp_path: Path,
) -> None:
    """The text of a result that is signed, verified in Python and at the shell."""
    assert run("certify", "ea70", "--procedure", "bbcor", "--seed", "7", "--out", "signed")[0] == 0
    (tmp_path / "signed" / "SHA256SUMS.sig").write_bytes(b"unreadable")
    needed = "checking the signature needs the public key"
    assert f"{needed} (key=)" in vl.verify(tmp_path / "signed").text
    out = run("verify", "signed", "--json")[1]
    assert f"{needed} (--key)" in str(json.loads(out))
