"""A part equals its block to the last bit, with all columns of its study."""

from __future__ import annotations

import io
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import virtual_lab as vl
from tests.campaigns.conftest import COLUMN, KEY, part
from virtual_lab.campaigns import digests, parts
from virtual_lab.campaigns.folder import Campaign
from virtual_lab.campaigns.parts import Block, write_part
from virtual_lab.campaigns.study import StudyCase
from virtual_lab.campaigns.summary import summary_of
from virtual_lab.errors import InputError
from virtual_lab.lab.setup import TestSetup as Setup

HEIGHTS = "impact.gates.height_u"


@pytest.fixture(scope="module")
def mixed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a campaign of two procedures with different budgets; in one case a u is 0."""
    folder = tmp_path_factory.mktemp("mixed") / "campaign"
    study = {
        "bats": "r161",
        "procedures": ["astm-f1881", "proposed"],
        "laboratories": 2,
        "seed": 3,
        "change": {KEY: [0.0, 0.05]},
    }
    assert vl.campaign(study, folder).missing == {}
    return folder


def test_every_part_has_the_columns_of_all_parts(mixed: Path) -> None:
    """Readers of a folder use the columns of its first file, so all parts have all columns."""
    files = sorted((mixed / "parts").iterdir())
    tables = [pd.read_parquet(each) for each in files]
    assert len(files) == 4
    for table in tables[1:]:
        assert list(table.columns) == list(tables[0].columns)
        assert list(table.dtypes) == list(tables[0].dtypes)
    whole = pd.read_parquet(mixed / "parts")
    assert list(whole.columns) == list(vl.Campaign.open(mixed).table.columns)
    assert whole.notna().any().all()  # no column exists that no test has
    squares = (whole.filter(like="contribution.") ** 2).sum(axis=1)
    assert squares.to_numpy() == pytest.approx(whole["u"].to_numpy() ** 2, rel=1e-9)


def test_a_column_is_blank_where_the_test_has_no_such_number(mixed: Path) -> None:
    """Only a scan has a curve, and distances without uncertainty contribute nothing."""
    table = vl.Campaign.open(mixed).table
    blank = {name: table[table[name].isna()] for name in table}
    one_place, two_gates = table["procedure"] == "astm-f1881", table[COLUMN] == 0
    for name, rows in (
        ("metric_of_continuous_curve_true", one_place),
        ("contribution.impact.gates.height_0", one_place),
        ("contribution.impact.encoder.scale", ~one_place),
        ("contribution.impact.gates.distance_0", two_gates),
        ("contribution.hits", table["u"].isna()),
    ):
        assert list(blank[name].index) == list(table[rows].index), name


def test_units_of_a_study_of_two_metrics_stand_in_the_parts(mixed: Path) -> None:
    units = [
        {field.name: field.metadata[b"unit"].decode() for field in pq.read_schema(path)}
        for path in sorted((mixed / "parts").iterdir())
    ]
    assert [own["value"] for own in units] == ["1", "1", "m/s", "m/s"]
    assert {own["metric_of_continuous_curve_true"] for own in units} == {"m/s"}
    assert Campaign.open(mixed).check().missing == {}


def test_a_number_that_the_first_laboratories_do_not_show_is_no_lost_column(
    mixed: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    known = Campaign.open(mixed)
    layout = dict(known.layout(known.block(1)))
    del layout["contribution.hits"]
    with pytest.raises(ValueError, match=r"have no contribution\.hits"):
        parts.table_of(known.block(1), 3, layout)


def test_blocks_of_a_case_have_laboratories_one_after_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each laboratory of a case is tested once, however the case is divided into parts."""
    study = {"bats": "r161", "procedures": "astm-f1881", "laboratories": 6, "seed": 5}
    vl.campaign(study, tmp_path / "one")
    one = vl.Campaign.open(tmp_path / "one").table
    monkeypatch.setattr("virtual_lab.campaigns.folder.ROWS", 4)
    assert vl.campaign(study, tmp_path / "two").parts == 2
    two = vl.Campaign.open(tmp_path / "two").table
    assert list(two["laboratory"]) == [0, 1, 2, 3, 4, 5]
    assert two["value"].nunique() == 6
    pd.testing.assert_frame_equal(one, two, rtol=1e-9)


def test_a_source_that_some_laboratories_lack_contributes_nothing_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Two blocks by hand: only the first has the source, and the last test has no result."""
    u, share = ("u", "1"), ("contribution.tilt", "1")
    blocks = [
        {u: np.array([0.2, 0.3]), share: np.array([0.1, 0.2])},
        {u: np.array([0.4, np.nan])},
    ]
    shared = SimpleNamespace(
        setup=Setup.of("r161", procedure="astm-f1881"), blocks=lambda *_: iter(blocks)
    )
    case = SimpleNamespace(
        bat="r161",
        procedure="astm-f1881",
        apply_changes=lambda: ({}, {}),
        round_robin=lambda *_: shared,
    )
    monkeypatch.setattr(parts, "_columns", lambda block: block)
    columns = parts._test_block(Block(0, case, 0, 0, 4, ""), 3)
    assert columns[share].to_pylist() == [0.1, 0.2, 0.0, None]


def test_laboratories_of_an_individual_study_have_the_bats_of_their_certificates(
    tmp_path: Path,
) -> None:
    """The true values are those of ``certify --seed 5 --number 1``, whose bat is individual."""
    study = {"bats": "r161", "procedures": "astm-f1881", "laboratories": 2, "seed": 5}
    true = {}
    for individual in (False, True):
        folder = tmp_path / str(individual)
        vl.campaign({**study, "individual": individual}, folder)
        true[individual] = vl.Campaign.open(folder).table["true_value"][1]
    sealed = vl.certify("r161", seed=5, number=1).sealed
    assert sealed is not None
    assert true[True] == pytest.approx(sealed.measurand["metric"], rel=1e-9)
    assert true[False] != pytest.approx(sealed.measurand["metric"], rel=1e-5)


# --- parts that are not what was made ---------------------------------------------------------


def rewritten(change: Callable[[pa.Table], pa.Table]) -> Callable[[Path], None]:
    """Return damage by another program, which keeps the description in the file."""

    def damage(path: Path) -> None:
        pq.write_table(change(pq.read_table(path)), path)

    return damage


def with_column(name: str, values: list[Any]) -> Callable[[pa.Table], pa.Table]:
    return lambda table: table.set_column(
        table.column_names.index(name), name, pa.array(values * len(table))
    )


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


def folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


def words(text: str) -> Callable[[Path], None]:
    """Return damage to the description of a part, with right digests."""
    blanks = (
        f'{{"{digests.DATA}": "{digests.NO_DIGEST}", "{digests.FOOTER}": "{digests.NO_DIGEST}"}}'
    )

    def damage(path: Path) -> None:
        table, file = pq.read_table(path), io.BytesIO()
        about = text.replace("BLANKS", blanks)
        pq.write_table(table.replace_schema_metadata({parts.ABOUT: about}), file)
        path.write_bytes(digests.with_digests(file.getvalue()))

    return damage


def plain_words(text: str) -> Callable[[Path], None]:
    return rewritten(lambda table: table.replace_schema_metadata({parts.ABOUT: text}))


DAMAGE = {
    "a metric of 99": (rewritten(with_column("value", [99.0])), "changed after it was made"),
    "text for a number": (rewritten(with_column("value", ["99"])), "changed after it was made"),
    "no verdict": (rewritten(with_column("verdict", [None])), "changed after it was made"),
    "two columns": (rewritten(lambda table: table.select(["u", "low"])), "changed after"),
    "the same numbers": (rewritten(lambda table: table), "changed after it was made"),
    "words: a list": (plain_words("[1]"), "changed after it was made"),
    "words: null": (plain_words("null"), "changed after it was made"),
    "words: deep": (plain_words("[" * 100_000), "changed after it was made"),
    "right digests: a list": (words("[BLANKS]"), "expected an object"),
    "right digests: deep": (words("[" * 100_000 + "BLANKS"), "nested deeper"),
    "right digests: no name": (words("BLANKS"), "other tests"),
    "a pipe": (pipe, "is not a file"),
    "a folder": (folder, "is not a file"),
    "nothing in it": (lambda path: path.write_bytes(b""), "not a Parquet file"),
    "a text": (lambda path: path.write_bytes(b"nothing that is a part"), "not a Parquet file"),
}


@pytest.mark.skipif(sys.platform == "win32", reason="has no named pipes")
@pytest.mark.parametrize("kind", DAMAGE)
def test_an_altered_part_is_reported(kind: str, copy: Path) -> None:
    damage, said = DAMAGE[kind]
    damage(part(copy, 1))
    known = Campaign.open(copy)
    (why,) = known.check().missing.values()
    assert said in why
    assert "\n" not in why
    assert known.part(1).wrong == why  # damage to the footer alone
    assert len(known.table) == 18
    assert [row["missing"] for row in known.summary()] == [6, 0]


def test_check_unpacks_nothing_that_was_changed(
    copy: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A changed file of 46 kB might unpack to 2.4 GB."""
    table = pq.read_table(part(copy, 0))
    pq.write_table(pa.concat_tables([table] * 100), part(copy, 0), compression="zstd")

    def unpack(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr(pq, "read_table", unpack)
    assert Campaign.open(copy).part(0, whole=True).wrong


def test_any_flipped_bit_of_a_footer_is_detected(copy: Path) -> None:
    """Four hundred bits, spread by the golden section, are flipped one at a time."""
    path, known = part(copy, 0), Campaign.open(copy)
    sound = path.read_bytes()
    length = int.from_bytes(sound[-8:-4], "little") + 8
    unseen = []
    for number in range(400):
        bit = int(8 * length * (number * 0.6180339887 % 1))
        changed = bytearray(sound)
        changed[len(sound) - length + bit // 8] ^= 1 << bit % 8
        path.write_bytes(changed)
        if not known.part(0).wrong:
            unseen.append(bit)
    assert unseen == []


def renamed(table: pa.Table) -> pa.Table:
    return table.rename_columns(
        ["oalue" if name == "value" else name for name in table.column_names]
    )


def other_type(table: pa.Table) -> pa.Table:
    field = table.schema.field("u").with_type(pa.float32())
    return table.cast(table.schema.set(table.column_names.index("u"), field))


def other_unit(table: pa.Table) -> pa.Table:
    field = table.schema.field("u").with_metadata({"unit": "mm"})
    return table.cast(table.schema.set(table.column_names.index("u"), field))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (renamed, "value, oalue"),
        (other_type, "of the study: u"),
        (other_unit, "of the study: u"),
        (lambda table: table.drop_columns(["u"]), "of the study: u"),
        (lambda table: table.append_column("more", table["u"]), "more"),
        (lambda table: table.append_column("u", table["u"]), "those of the study"),
    ],
)
def test_a_part_with_other_columns_than_the_study_is_refused(
    change: Callable[[pa.Table], pa.Table], said: str, copy: Path
) -> None:
    """Names, types and units are compared even if the digests are right."""
    known = Campaign.open(copy)
    write_part(change(pq.read_table(part(copy, 0))), copy / "parts", known.block(0))
    (why,) = known.check().missing.values()
    assert "its columns are not those of the study" in why
    assert said in why


def with_value(name: str, value: object) -> Callable[[pa.Table], pa.Table]:
    """Return a change of all cells of a column, which keeps its type, unit and meaning."""

    def change(table: pa.Table) -> pa.Table:
        field = table.schema.field(name)
        cells = pa.array([value] * len(table), field.type)
        return table.set_column(table.column_names.index(name), field, cells)

    return change


def swapped(table: pa.Table) -> pa.Table:
    return table.take([1, 0, 2, 3, 4, 5])


@pytest.mark.parametrize(
    ("change", "column"),
    [
        (swapped, "laboratory"),
        (with_value("bat", "ea70"), "bat"),
        (with_value("procedure", "bbcor"), "procedure"),
        (with_value("repeat", 1), "repeat"),
        (with_value("verdict", "PERHAPS"), "verdict"),
        (with_value("verdict", None), "verdict"),
        (with_value("value", 99.0), "value"),
        (with_value("low", None), "value"),
    ],
)
def test_a_part_made_again_must_hold_the_tests_of_its_block(
    change: Callable[[pa.Table], pa.Table], column: str, copy: Path
) -> None:
    """The digests are right: our own function wrote the part."""
    known = Campaign.open(copy)
    write_part(change(pq.read_table(part(copy, 0))), copy / "parts", known.block(0))
    (why,) = known.check().missing.values()
    assert why == f"these columns contradict the study: {column}"
    assert len(known.table) == 18


@pytest.mark.parametrize("key", ["sheets", "layouts"])
def test_an_edited_sheet_or_column_of_the_folder_is_refused(key: str, copy: Path) -> None:
    path = copy / "campaign.json"
    stamp = json.loads(path.read_text("utf-8"))
    if key == "sheets":
        text = stamp["sheets"]["instruments/pivot-gates"]
        stamp["sheets"]["instruments/pivot-gates"] = text.replace(
            "verified = false", "verified = true"
        )
        assert stamp["sheets"]["instruments/pivot-gates"] != text
    else:
        stamp["layouts"]["astm-f1881"]["value"] = ["double", "m"]
    path.write_text(json.dumps(stamp), "utf-8")
    part(copy, 0).unlink()
    with pytest.raises(InputError, match=r"digest = .*changed"):
        vl.campaign(None, copy)


def test_the_summary_tells_above_from_below() -> None:
    """Four tests by hand: two true values are above their intervals, one below, one within."""
    table = pa.table(
        {
            "verdict": ["PASS"] * 4,
            "flag_names": [""] * 4,
            "value": [1.0, 1.0, 1.0, 1.0],
            "u": [0.1] * 4,
            "low": [0.8] * 4,
            "high": [1.2] * 4,
            "true_value": [1.3, 1.25, 0.7, 1.0],
        }
    )
    case = StudyCase("r161", "astm-f1881", False, {})
    whole: Any = SimpleNamespace(
        block=Block(0, case, 0, 0, 4, "a.parquet"),
        wrong="",
        table=table.select,
    )
    row = summary_of(case, {}, "", [whole])
    assert (row["above"], row["below"], row["coverage"]) == (0.5, 0.25, 0.25)
    assert row["bias"] == pytest.approx(-0.0625)
