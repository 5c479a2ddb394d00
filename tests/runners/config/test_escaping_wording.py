"""Counts, tables and comments in markup."""

import pytest

from runners.config.escaping import counted, markdown_table, without_markup


@pytest.mark.parametrize(
    ("number", "words"), [(0, "0 worlds"), (1, "1 world"), (2, "2 worlds"), (1234, "1,234 worlds")]
)
def test_a_number_of_things(number, words):
    assert counted(number, "world") == words


def test_a_cell_cannot_end_its_column():
    assert markdown_table([["a|b", "c"], ["---", "---:"], ["|x|", "1"]]) == (
        "| a\\|b | c |\n| --- | ---: |\n| \\|x\\| | 1 |"
    )


def test_marks_count_only_within_backticks():
    assert without_markup("a_b `c_d*` [e]", "_*[") == "a\\_b `c_d*` \\[e]"
