"""Text tables: empty cells, empty columns and columns of inner rows."""

from dataclasses import dataclass

from virtual_lab.output.tables import column, inline, table_text

ROWS = [{"plan": "present", "price": None, "u": None}, {"plan": "1", "price": None, "u": 0.25}]


def test_column_without_a_value_is_not_printed():
    assert table_text(ROWS) == "plan     u\npresent\n1        0.25"


def test_transposed_table_has_no_line_without_a_value():
    assert (
        table_text(ROWS, across="plan") == "      present  1\nplan  present  1\nu              0.25"
    )


def test_columns_of_an_inline_field_have_no_prefix():
    @dataclass
    class Fit:
        rms: float = column("rms", "mm")
        count: int = column("points", form=lambda fit: f"{fit.count} of 9")

    @dataclass
    class Row:
        name: str = column("bat")
        recoil: Fit
        other: Fit = inline()

    row = Row(name="r161", recoil=Fit(0.5, 7), other=Fit(0.25, 8))
    lines = [line.split("  ") for line in table_text([row], across="name").splitlines()]
    assert [[cell.strip() for cell in line if cell] for line in lines] == [
        ["r161"],
        ["bat", "r161"],
        ["recoil: rms [mm]", "0.5"],
        ["recoil: points", "7 of 9"],
        ["rms [mm]", "0.25"],
        ["points", "8 of 9"],
    ]
