"""The parts of a campaign have its laboratories' results, and no event loses a part."""

from __future__ import annotations

import json
import os
import re
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

import virtual_lab as vl
from tests.campaigns.conftest import COLUMN, KEY, STUDY, begun, contents, part
from virtual_lab import catalog, lab
from virtual_lab.campaigns import running, workers
from virtual_lab.campaigns.folder import PARTS, Campaign
from virtual_lab.campaigns.summary import VERDICTS
from virtual_lab.cli import cli
from virtual_lab.errors import InputError
from virtual_lab.files.dictionary import COLUMNS, column_meaning


@pytest.mark.parametrize("repeat", [0, 1])
def test_a_row_is_the_laboratory_of_its_number_and_day(made: Path, repeat: int) -> None:
    """The oracle is the loop over laboratories, budget line by line."""
    with catalog.sheets_in_place({("instruments", "pivot-gates"): changed_gates(0.1)}):
        setup = lab.RoundRobin.of("r161", "astm-f1881").setup
        setup = replace(setup, seed=5, number=3, test=repeat or None)
        tested = lab.run_test(lab.Laboratory.open(setup)).of(0)
    found = vl.Campaign.open(made).table
    (row,) = found[
        (found["repeat"] == repeat) & (found["laboratory"] == 3) & (found[COLUMN] == 0.1)
    ].to_dict("records")
    metric = tested.certification.metric
    assert metric is not None
    assert row["bat"] == "r161"
    assert row["procedure"] == "astm-f1881"
    assert row["verdict"] == tested.certification.verdict.value
    assert row["flag_names"].split() == [flag.name for flag in tested.certification.flags]
    for name, value in (("value", metric.value), ("u", metric.u), ("dof", metric.dof)):
        assert row[name] == pytest.approx(value, rel=1e-9), name
    assert (row["low"], row["high"]) == pytest.approx(metric.interval_95, rel=1e-9)
    assert row["true_value"] == pytest.approx(tested.sealed.measurand["metric"], rel=1e-9)
    for name, budget in tested.certification.quantities.items():
        assert row[name] == pytest.approx(budget.value, rel=1e-9)
        assert row[f"{name}_u"] == pytest.approx(budget.u, rel=1e-9)
        assert row[f"{name}_true"] == pytest.approx(tested.sealed.measurand[name], rel=1e-9)
    stated = {line.name: line.contribution for line in metric.components}
    prefix = "contribution."
    columns = {key.removeprefix(prefix): row[key] for key in row if key.startswith(prefix)}
    assert columns == pytest.approx(stated, rel=1e-9, abs=1e-15)


def changed_gates(distance_u_mm: float) -> str:
    return vl.instrument("pivot-gates").with_(distance_u=distance_u_mm).text


def test_a_column_states_its_unit_and_meaning(made: Path) -> None:
    schema = pq.read_schema(part(made, 0))
    units = {field.name: field.metadata[b"unit"].decode() for field in schema}
    assert units["verdict"] == units["laboratory"] == ""
    assert units["value"] == units["u"] == units["contribution.hits"] == "1"
    assert units[COLUMN] == "mm"
    meanings = {field.name: field.metadata[b"meaning"].decode() for field in schema}
    assert all(meanings.values())
    assert meanings["contribution.hits"] == "contribution of hits to u"
    assert (
        meanings["ball_restitution_u"]
        == f"standard uncertainty: {COLUMNS['ball_restitution'].meaning}"
    )
    assert meanings["u"] == COLUMNS["u"].meaning


def test_each_column_of_a_campaign_is_in_the_dictionary(made: Path) -> None:
    """That of a changed key is described by its sheet."""
    table = vl.Campaign.open(made).table
    unknown = [name for name in table if column_meaning(name) is None]
    assert unknown == [COLUMN]
    units = table.attrs["units"]
    assert list(units) == list(table.columns)
    assert (units["value"], units["bat"], units[COLUMN]) == ("1", "", "mm")
    summary = vl.Campaign.open(made).summary().table
    assert [name for name in summary if column_meaning(name) is None] == [COLUMN]
    assert summary.attrs["units"]["sd"] == "1"


def test_numbers_of_a_changed_key_have_the_unit_of_its_sheet(tmp_path: Path) -> None:
    """0.1 mm and 0.005 in are columns of millimeters."""
    study = {"bats": "r161", "procedures": "astm-f1881", "laboratories": 1, "seed": 1}
    vl.campaign({**study, "change": {KEY: ["0.1 mm", "0.005 in"]}}, tmp_path / "c")
    assert vl.Campaign.open(tmp_path / "c").table[COLUMN].tolist() == pytest.approx([0.1, 0.127])


def test_a_metric_that_is_a_speed_keeps_its_unit(tmp_path: Path) -> None:
    """The metric of `proposed` is v_f, about 95 mph; its scan has a width in m."""
    study = {"bats": "r161", "procedures": "proposed", "laboratories": 2, "seed": 1}
    vl.campaign(study, tmp_path / "c")
    schema = pq.read_schema(part(tmp_path / "c", 0))
    units = {field.name: field.metadata[b"unit"].decode() for field in schema}
    assert units["value"] == units["low"] == units["contribution.hits"] == "m/s"
    assert units["metric_of_continuous_curve_true"] == "m/s"
    assert units["restitution"] == units["dof"] == "1"
    table = vl.Campaign.open(tmp_path / "c").table
    assert table["value"].between(35, 50).all()


def test_a_test_without_a_result_is_blank(tmp_path: Path) -> None:
    """No hit meets a window of the recoil fit, so the tests are INVALID."""
    rules = vl.procedure("astm-f1881").with_({"windows.recoil_u": 1e-6})
    study = {"bats": ["r161"], "procedures": [rules], "laboratories": 3, "seed": 1}
    vl.campaign(study, tmp_path / "c")
    table = vl.Campaign.open(tmp_path / "c").table
    assert (table["verdict"] == "INVALID").all()
    blank = table[["value", "u", "low", "true_value", "restitution", "contribution.hits"]]
    assert blank.isna().all(axis=None)
    (row,) = vl.Campaign.open(tmp_path / "c").summary()
    assert (row["tests"], row["mean"], row["coverage"]) == (3, None, None)


def test_the_folder_keeps_the_study_file_unchanged(made: Path) -> None:
    assert (made / "study.toml").read_text("utf-8") == STUDY


def test_a_campaign_keeps_the_sheets_its_tests_read(made: Path, tmp_path: Path) -> None:
    """A block reads no other sheet; a user's sheet is stored with the folder."""
    known = Campaign.open(made)
    with catalog.sheets_in_place({}) as used:
        workers.table_of(known.block(0), 5, known.layout(known.block(0)))
    assert {"/".join(key) for key in used} <= set(known.sheets)
    own = vl.procedure("astm-f1881").with_(valid_hits=4)
    study = {"bats": ["r161"], "procedures": own, "laboratories": 2, "seed": 1}
    vl.campaign(study, tmp_path / "own", blocks="1/1")
    part(tmp_path / "own", 0).unlink()
    assert vl.campaign(None, tmp_path / "own").made == 1
    assert "valid_hits=4" in vl.Campaign.open(tmp_path / "own").table["procedure"][0]


def test_two_workers_make_the_same_parts_as_one(made: Path, tmp_path: Path) -> None:
    account = vl.campaign(begun(tmp_path / "two"), tmp_path / "two", workers=2)
    assert account.made == 4
    assert contents(tmp_path / "two") == contents(made)


def test_two_runs_in_one_folder_do_no_harm(made: Path, tmp_path: Path) -> None:
    """Both start it and make its parts; each file is complete at any time."""
    folder, study = tmp_path / "both", begun(tmp_path / "both")
    with ThreadPoolExecutor(2) as pool:
        runs = [pool.submit(vl.campaign, study, folder) for _ in range(2)]
        accounts = [run.result() for run in runs]
    assert [account.missing for account in accounts] == [{}, {}]
    assert contents(folder) == contents(made)


def test_shares_cover_every_part_once(made: Path) -> None:
    known = Campaign.open(made)
    for many in (1, 3, 4, 40):
        shares = [number for one in range(many) for number in known.share(f"{one + 1}/{many}")]
        assert shares == [0, 1, 2, 3]


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-100])


def swap(path: Path) -> None:
    shutil.copy(part(path.parents[1], 1), path)


def lose(path: Path) -> None:
    path.unlink()


@pytest.mark.parametrize(("damage", "said"), [(cut, "cannot be read"), (swap, "other tests")])
def test_a_damaged_part_is_repeated_and_reported(
    copy: Path, made: Path, damage: Callable[[Path], None], said: str
) -> None:
    damage(part(copy, 2))
    account = vl.Campaign.open(copy).check()
    assert (account.code, [said in why for why in account.missing.values()]) == (4, [True])
    account = vl.campaign(None, copy)
    ((name, why),) = account.again.items()
    assert said in why
    assert name == f"r161 by astm-f1881, {KEY} = 0.1, repeat 0, laboratories 0 to 5"
    assert contents(copy) == contents(made)


@pytest.mark.skipif(sys.platform == "win32", reason="has no limit of a file's size")
def test_a_write_that_fails_leaves_nothing_and_loses_nothing(copy: Path, made: Path) -> None:
    """A limit of the file size simulates a full disk."""
    import resource

    part(copy, 3).unlink()
    before = contents(copy)
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, hard))
    try:
        with pytest.raises(InputError, match="cannot be written"):
            vl.campaign(None, copy)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert contents(copy) == before
    assert [path.name for path in (copy / PARTS).iterdir() if path.is_dir()] == []
    vl.campaign(None, copy)
    assert contents(copy) == contents(made)


def children(pid: int) -> set[int]:
    """Return the processes that a process started."""
    tasks = Path(f"/proc/{pid}/task").glob("*/children")
    return {int(child) for task in tasks for child in task.read_text("utf-8").split()}


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs Linux")
def test_workers_end_with_a_parent_that_is_killed(copy: Path, made: Path) -> None:
    for number in (0, 1):
        part(copy, number).unlink()
    command = [sys.executable, "-m", "virtual_lab", "campaign", "resume", str(copy)]
    with subprocess.Popen([*command, "--workers", "2"], cwd=copy) as parent:
        until(lambda: len(children(parent.pid)) == 2)
        orphans = children(parent.pid)
        parent.kill()
    until(lambda: not any(Path(f"/proc/{child}").exists() for child in orphans))
    vl.campaign(None, copy)
    assert contents(copy) == contents(made)


def until(done: Callable[[], bool], patience: float = 60.0) -> None:
    """Wait until a condition holds."""
    end = time.monotonic() + patience
    while not done():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_existing_parts_are_not_repeated(copy: Path) -> None:
    kept, lost = part(copy, 0), part(copy, 3)
    before = kept.stat().st_mtime_ns
    lost.unlink()
    assert vl.campaign(None, copy).made == 1
    assert kept.stat().st_mtime_ns == before


def test_check_finds_a_changed_byte_within_a_part(copy: Path) -> None:
    """The footer, unchanged, has the digest of the data."""
    path = part(copy, 1)
    data = bytearray(path.read_bytes())
    group = pq.read_metadata(path).row_group(0)
    columns = (group.column(at) for at in range(group.num_columns))
    largest = max(columns, key=lambda each: each.total_compressed_size)
    data[largest.data_page_offset + largest.total_compressed_size // 2] ^= 1
    path.write_bytes(data)
    (why,) = Campaign.open(copy).check().missing.values()
    assert why == "it was changed after it was made (its data)"


def test_a_block_that_fails_twice_is_reported_and_the_others_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    tried: list[int] = []
    sound = workers.table_of

    def table_of(block: Any, *rest: Any) -> Any:
        tried.append(block.number)
        if block.number == 2 or (block.number == 1 and tried.count(1) == 1):
            raise ZeroDivisionError("by nothing")
        return sound(block, *rest)

    monkeypatch.setattr(workers, "table_of", table_of)
    account = vl.campaign(begun(tmp_path / "c"), tmp_path / "c")
    assert tried == [0, 1, 2, 3, 1, 2]
    assert (account.made, account.code) == (3, 4)
    name = f"r161 by astm-f1881, {KEY} = 0.1, repeat 0, laboratories 0 to 5"
    assert account.missing == {name: "ZeroDivisionError: by nothing"}
    assert name in account.text
    rows = vl.Campaign.open(tmp_path / "c").summary().rows
    assert [row["missing"] for row in rows] == [0, 6]


def test_the_summary_agrees_with_the_table(made: Path) -> None:
    """The oracle is pandas; the variance within a laboratory is half the squared difference."""
    summary = vl.Campaign.open(made).summary()
    table = vl.Campaign.open(made).table
    for row, (_, own) in zip(summary, table.groupby(COLUMN), strict=True):
        sound = own[own["verdict"] != "INVALID"]
        error = sound["value"] - sound["true_value"]
        held = (sound["true_value"] >= sound["low"]) & (sound["true_value"] <= sound["high"])
        pairs = sound.pivot_table(index="laboratory", columns="repeat", values="value")
        within = np.sqrt(((pairs[0] - pairs[1]) ** 2 / 2).mean())
        assert row["tests"] == 12
        counts = own["verdict"].value_counts()
        assert all(row[f"verdict_{name}"] == counts.get(name, 0) for name in VERDICTS)
        stated = {
            "mean": sound["value"].mean(),
            "sd": sound["value"].std(),
            "sd_within": within,
            "rms_u": np.sqrt((sound["u"] ** 2).mean()),
            "bias": error.mean(),
            "bias_se": error.sem(),
            "coverage": held.mean(),
        }
        assert {name: row[name] for name in stated} == pytest.approx(stated, rel=1e-9)
    words = json.dumps(summary.document)
    assert str(made) not in words
    assert "workers" not in words


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("laboratories = 6", "laboratories = 0", "laboratories = 0"),
        ("laboratories = 6", "laboratories = 1000000000000000", "4294967296"),
        ("gates.distance_u", "gates.distence_u", "did you mean distance_u"),
        ("impact.gates", "impacts.gates", "did you mean impact"),
        ("gates.distance_u", "gates", "gates"),
        (f'"{KEY}" = [0.05, 0.1]', '"impact.pivot.friction" = [-1]', "friction"),
        ("[0.05, 0.1]", "[]", "at least 1"),
        ("[0.05, 0.1]", '[0.05, "0.1 mm"]', "distance_u"),
        ("[0.05, 0.1]", '["0.1 kg"]', "kg"),
        ("r161", "r162", "did you mean r161"),
        ('["r161"]', '["r161", "r161"]', "twice"),
        ("seed = 5", "sead = 5", "did you mean seed"),
        ("repeats = 2", "repeats = 0", "repeats = 0"),
    ],
)
def test_a_study_that_cannot_be_used_makes_no_folder(
    old: str, new: str, said: str, tmp_path: Path
) -> None:
    assert old in STUDY
    study = begun(tmp_path / "c", STUDY.replace(old, new))
    with pytest.raises(InputError) as fault:
        vl.campaign(study, tmp_path / "c")
    assert said in str(fault.value)
    assert str(fault.value).startswith(f"{study}: ") or "r161" in said
    assert "\n" not in str(fault.value)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["study.toml"]


@pytest.mark.parametrize("wrong", [{"blocks": "7/2"}, {"dask": "nohost"}, {"workers": 0}])
def test_a_refused_argument_makes_no_folder(wrong: dict[str, Any], tmp_path: Path) -> None:
    study = begun(tmp_path / "c")
    with pytest.raises(InputError):
        vl.campaign(study, tmp_path / "c", **wrong)
    with pytest.raises(InputError, match="there is no folder"):
        vl.campaign(study, tmp_path / "mistyped" / "c")
    assert [path.name for path in tmp_path.iterdir()] == ["study.toml"]


VERBS: dict[str, Callable[[Path], object]] = {
    "resume": lambda folder: vl.campaign(None, folder),
    "check": lambda folder: vl.Campaign.open(folder).check(),
    "summary": lambda folder: vl.Campaign.open(folder).summary(),
}


def foreign_file(folder: Path) -> None:
    (folder / PARTS / "0000001-0123456789abcdef.parquet").write_bytes(b"of another study")


def other_version(folder: Path) -> None:
    path = folder / "campaign.json"
    path.write_text(path.read_text("utf-8").replace('"program": "', '"program": "9'), "utf-8")


def other_schema(folder: Path) -> None:
    stamp = json.loads((folder / "campaign.json").read_text("utf-8"))
    (folder / "campaign.json").write_text(json.dumps({**stamp, "schema": 2}), "utf-8")


def other_seed(folder: Path) -> None:
    (folder / "study.toml").write_text(STUDY.replace("seed = 5", "seed = 6"), "utf-8")


def no_study(folder: Path) -> None:
    (folder / "study.toml").unlink()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (foreign_file, "not part of this campaign"),
        (other_version, "of another version"),
        (other_schema, "schema = 2; this version reads only schema 4; begin the campaign in a new"),
        (other_seed, "digest"),
        (no_study, "cannot be read"),
    ],
)
@pytest.mark.parametrize("verb", VERBS)
def test_a_folder_that_is_not_this_campaign_is_left_alone(
    change: Callable[[Path], None], said: str, verb: str, copy: Path
) -> None:
    with pytest.raises(InputError, match="there is no such folder"):
        VERBS[verb](copy / "missing")
    change(copy)
    before = contents(copy)
    with pytest.raises(InputError, match=said):
        VERBS[verb](copy)
    assert contents(copy) == before


@pytest.mark.parametrize("blocks", ["0/40", "41/40", "3", "a/b", "1/0", "-1/3"])
def test_a_missing_share_is_refused(blocks: str, copy: Path) -> None:
    with pytest.raises(InputError, match="blocks"):
        vl.campaign(None, copy, blocks=blocks)


def test_another_study_may_not_have_the_folder(copy: Path, tmp_path: Path) -> None:
    other = begun(tmp_path / "x", STUDY.replace("seed = 5", "seed = 6"))
    with pytest.raises(InputError, match="holds another campaign"):
        vl.campaign(other, copy)


@pytest.mark.parametrize(("module", "extra"), [("pyarrow", "campaign"), ("distributed", "dask")])
def test_a_missing_extra_is_named(
    module: str, extra: str, copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lose(part(copy, 0))
    for name in [each for each in sys.modules if each.partition(".")[0] == module]:
        monkeypatch.setitem(sys.modules, name, None)  # type: ignore[arg-type]
    monkeypatch.setitem(sys.modules, module, None)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=rf"extra '{extra}'.*pip install '\.\[{extra}\]'"):
        vl.campaign(None, copy, dask="tcp://127.0.0.1:9" if extra == "dask" else None)


@pytest.fixture
def dask_address() -> Iterator[str]:
    """Yield the address of a scheduler with one worker, both in this process."""
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None
    ) as cluster:
        yield cluster.scheduler_address


@pytest.mark.filterwarnings("ignore")  # warning of Dask: a busy machine waits for its disk
def test_dask_makes_the_same_parts(copy: Path, made: Path, dask_address: str) -> None:
    for number in (0, 3):
        part(copy, number).unlink()
    assert vl.campaign(None, copy, dask=dask_address).made == 2
    assert contents(copy) == contents(made)


@pytest.fixture
def silent_address() -> Iterator[str]:
    """Yield the address of a port that accepts connections but never answers."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield f"tcp://127.0.0.1:{server.getsockname()[1]}"


@pytest.mark.filterwarnings("ignore")
def test_a_dask_address_without_an_answer_is_refused(
    copy: Path, silent_address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "PATIENCE", 0.2)
    part(copy, 0).unlink()
    wrong = ["nowhere", "", "tcp://", "http://127.0.0.1:9", "ucx://127.0.0.1:9", "tcp://[::1"]
    for address in (silent_address, "tcp://127.0.0.1:9", *wrong):
        with pytest.raises(InputError) as fault:
            vl.campaign(None, copy, dask=address)
        assert str(fault.value).startswith(f"dask = '{address}'; does not answer")


@pytest.mark.filterwarnings("ignore")
def test_a_dask_scheduler_without_workers_is_refused(
    copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """There is no worker from the start, or the only one ended before its first part."""
    from distributed import LocalCluster

    monkeypatch.setattr(workers, "PATIENCE", 0.2)
    part(copy, 0).unlink()
    with LocalCluster(n_workers=0, processes=False, dashboard_address=None) as cluster:
        with pytest.raises(InputError, match="has no worker; start one"):
            vl.campaign(None, copy, dask=cluster.scheduler_address)
        sound, calls = workers.threads_at, iter(range(9))
        monkeypatch.setattr(running, "threads_at", lambda at: 1)
        monkeypatch.setattr(workers, "threads_at", lambda at: sound(at) if next(calls) else 1)
        with pytest.raises(InputError, match="has no worker; start one"):
            vl.campaign(None, copy, dask=cluster.scheduler_address)


DOCS = Path(vl.__file__).parent / "docs" / "campaigns.md"


def block_of_docs(language: str, number: int = 0) -> str:
    found = re.findall(rf"^```{language}\n(.*?)^```", DOCS.read_text("utf-8"), re.DOTALL | re.M)
    return str(found[number])


def test_the_script_of_an_array_of_jobs_makes_the_campaign(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The script runs under bash with a stand-in for the program, which runs afterward."""
    program = tmp_path / "bin" / "virtual-lab"
    program.parent.mkdir()
    program.write_text('#!/bin/sh\nfor word; do echo "$word"; done > asked\n', "utf-8")
    program.chmod(0o755)
    begun(tmp_path / "million")
    monkeypatch.chdir(tmp_path)
    for job in ("2", "3", "1"):
        environment = os.environ | {
            "PATH": f"{program.parent}:{os.environ['PATH']}",
            "SLURM_ARRAY_TASK_ID": job,
            "SLURM_ARRAY_TASK_COUNT": "3",
        }
        subprocess.run(["bash", "-c", block_of_docs("bash")], env=environment, check=True)
        words = (tmp_path / "asked").read_text("utf-8").splitlines()
        assert cli.main(words, standalone_mode=False) == 0
    assert contents(tmp_path / "million") == contents(made)


def test_the_study_of_the_docs_can_be_used_and_its_lines_read_the_parts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    study = block_of_docs("toml").replace("laboratories = 100000", "laboratories = 2")
    vl.campaign(begun(tmp_path / "million", study), tmp_path / "million", blocks="1/4")
    names: dict[str, Any] = {"pd": pd}
    exec(block_of_docs("python").splitlines()[0], names)
    table = names["table"]
    pd.testing.assert_frame_equal(table, vl.Campaign.open(tmp_path / "million").table)
    assert list(table.columns[:6]) == ["bat", "procedure", *COLUMNS_OF_DOCS, "repeat", "laboratory"]


COLUMNS_OF_DOCS = ["impact.gates.distance_u_mm", "impact.pivot.from_knob_u_mm"]


def test_campaign_commands_check_resume_and_summarize(
    copy: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lose(part(copy, 1))
    assert cli.main(["campaign", "check", str(copy)], standalone_mode=False) == 4
    assert "missing, not made: r161 by astm-f1881" in capsys.readouterr().out
    assert cli.main(["campaign", "resume", str(copy), "--json"], standalone_mode=False) == 0
    assert json.loads(capsys.readouterr().out)["made"] == 1
    assert cli.main(["campaign", "summary", str(copy), "--json"], standalone_mode=False) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row[COLUMN] for row in rows] == [0.05, 0.1]
    assert cli.main(["campaign", "summary", str(copy)], standalone_mode=False) == 0
    _, *blocks, _ = capsys.readouterr().out.split("\n\n")
    assert blocks
    for block in blocks:  # each states the changed value of a row
        head = [line.split() for line in block.splitlines()[:-2]]
        assert all(any(word in line for line in head) for word in COLUMN.split("."))


HUGE = """
bats = ["r161"]
procedures = ["astm-f1881"]
laboratories = 4294967296
repeats = 1000
seed = 1
"""


def test_a_share_of_the_largest_study_starts_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its 524 million blocks get a name only when they are made; the first one fails here."""
    tried: list[int] = []

    def make_part(_folder: str, number: int) -> InputError:
        tried.append(number)
        return InputError("", "disk", None, "is full")

    monkeypatch.setattr(workers, "make_part", make_part)
    study, folder = begun(tmp_path / "c", HUGE), tmp_path / "c"
    for blocks, first in (("1/1000000", 0), ("1000000/1000000", 524287475), (None, 0)):
        with pytest.raises(InputError, match="is full"):
            vl.campaign(study, folder, blocks=blocks)
        assert tried.pop() == first
    known = Campaign.open(folder)
    assert known.blocks == 524288 * 1000
    assert known.tests(range(known.blocks)) == 2**32 * 1000


@pytest.mark.parametrize("laboratories", [1, 8191, 8192, 8193, 20000])
def test_tests_in_a_share_are_the_rows_of_its_blocks(made: Path, laboratories: int) -> None:
    known = Campaign.open(made)
    known = replace(known, study=replace(known.study, laboratories=laboratories, repeats=3))
    for many in (1, 4, 7):
        for one in range(many):
            numbers = known.share(f"{one + 1}/{many}")
            assert known.tests(numbers) == sum(known.block(number).rows for number in numbers)


def test_many_cases_are_counted_while_they_are_checked(tmp_path: Path) -> None:
    """Ten thousand crossed values take half a minute; progress counts each."""
    seen: list[tuple[str, int, int]] = []
    values = ", ".join(f"{0.05 + 0.001 * number:.3f}" for number in range(12))
    study = begun(tmp_path / "c", STUDY.replace("0.05, 0.1", values))
    vl.campaign(study, tmp_path / "c", blocks="1/1000", progress=lambda *each: seen.append(each))
    assert [each for each in seen if each[0] == "cases"] == [("cases", n, 12) for n in range(12)]


def test_a_folder_that_is_begun_is_not_checked_again(
    copy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each job of an array starts from the study's file."""

    def sheets(*_: object) -> None:
        raise AssertionError

    study = begun(tmp_path / "x")
    monkeypatch.setattr("virtual_lab.campaigns.study.Study.sheets", sheets)
    assert vl.campaign(study, copy).made == 0


def test_a_sheet_that_changed_since_the_campaign_began_is_another_campaign(
    copy: Path, tmp_path: Path
) -> None:
    study = begun(tmp_path / "x")
    gates = vl.instrument("pivot-gates").with_(tick="2 us")
    with (
        catalog.sheets_in_place({("instruments", "pivot-gates"): gates.text}),
        pytest.raises(InputError, match="holds another campaign"),
    ):
        vl.campaign(study, copy)


def test_a_seed_is_as_long_as_a_drawn_one(tmp_path: Path) -> None:
    """A hexadecimal number in a study's file may have any length."""
    for digits in (f"{2**128:#x}", "0x" + "f" * 9000):
        study = begun(tmp_path / "c", STUDY.replace("seed = 5", f"seed = {digits}"))
        with pytest.raises(InputError, match=f"seed = .*less than or equal to {2**128 - 1}"):
            vl.campaign(study, tmp_path / "c")
    largest = {"bats": "r161", "procedures": "astm-f1881", "laboratories": 1, "seed": 2**128 - 1}
    assert vl.campaign(largest, tmp_path / "d").made == 1
