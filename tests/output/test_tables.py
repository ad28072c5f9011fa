"""Text tables: empty cells and empty columns."""

from virtual_lab.output.tables import table_text

ROWS = [{"plan": "present", "price": None, "u": None}, {"plan": "1", "price": None, "u": 0.25}]


def test_column_without_a_value_is_not_printed():
    assert table_text(ROWS) == "plan     u\npresent\n1        0.25"


def test_transposed_table_has_no_line_without_a_value():
    assert (
        table_text(ROWS, across="plan") == "      present  1\nplan  present  1\nu              0.25"
    )
