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


def test_a_speed_is_printed_in_both_units() -> None:
    """60 mph are 88 ft/s, 26.82 m/s; a table of mappings states no unit."""

    @dataclass
    class Row:
        speed: float = column("speed", "mph", "+.2f")

    assert table_text([Row(60.0)]) == "speed [mph (m/s)]\n+60.00 (+26.82)"
    assert table_text([{"speed": 60.0}]) == "speed\n60"


def test_a_wide_table_has_heads_of_several_lines_and_blocks() -> None:
    """Every number is in the text once, in a line of its row, and no line is too wide."""
    rows = [
        {"plan": f"p{row}", **{f"number of hits {n} per ball": 100 * row + n for n in range(20)}}
        for row in (1, 2)
    ]
    text = table_text(rows)
    assert max(map(len, text.splitlines())) <= 110
    for row in rows:
        lines = [line.split() for line in text.splitlines() if line.startswith(row["plan"])]
        numbers = [int(cell) for line in lines for cell in line[1:]]
        assert numbers == [value for value in row.values() if value != row["plan"]]
    blocks = text.split("\n\n")
    assert len(blocks) > 1
    assert all(block.splitlines()[-3].split()[0] == "plan" for block in blocks)
    shared = [{"sheet": "gates", "bat": bat, "key": key} for bat in "abb" for key in "uv"]
    blocks = table_text([row | {f"number {n}": n + 1e6 for n in range(20)} for row in shared])
    first, *others = blocks.split("\n\n")
    assert "sheet" in first
    for (
        block
    ) in others:  # the labels that distinguish the lines: neither the sheet nor the bat alone
        assert [line.split()[:2] for line in block.splitlines()[-6:]] == [
            [row["bat"], row["key"]] for row in shared
        ]
    narrow = table_text([{"plan": "p" * 80, "number of hits per ball": 3}])
    assert len(narrow.splitlines()) == 2
    assert not any(block.startswith("\n") for block in [first, *others])
    long = table_text([{"key": "profile", "value": "2.2991, " * 40}, {"key": "mass", "value": "1"}])
    lines = long.splitlines()
    assert max(map(len, lines)) <= 110
    assert [line[:7].strip() for line in lines] == ["key", "profile", "", "", "", "mass"]
    assert " ".join(long.split()).count("2.2991,") == 40


def test_a_long_text_has_several_lines_before_the_table_has_blocks() -> None:
    rows = [
        {"plan": name, **{f"number of hits {n}": 1000 + n for n in range(8)}, "instruments": names}
        for name, names in (("first", "ball-cannon, " * 4), ("second", "none"))
    ]
    text = table_text(rows)
    lines = text.splitlines()
    assert max(map(len, lines)) <= 110
    assert "" not in lines
    assert [line.split()[0] for line in lines if line[0] != " "] == ["plan", "first", "second"]
    assert text.count("ball-cannon,") == 4
