"""A table of cells as Markdown and as a LaTeX float."""

from runners.reports.analysis.text_table import Strong, TextTable

TABLE = TextTable(
    ["Run", "Measure", "x_1"], [["a&b", "S", Strong("−1")], ["a&b", "T", "2"], ["[c]", "S", "3"]], (0, 1)
)


def rows_of(text):
    return text.split("\\toprule\n")[1].split("\\bottomrule")[0].splitlines()


def test_markdown_has_words_left_and_numbers_right():
    header, rule, first, *_ = TABLE.to_markdown().splitlines()
    assert (header, rule) == ("| Run | Measure | x_1 |", "| --- | --- | ---: |")
    assert first == "| a&b | S | **−1** |"


def test_latex_writes_a_repeated_name_once_and_sets_groups_apart():
    text = TABLE.to_latex("tab:x", "10 % of it", ["[1] note", "R&D"])
    assert rows_of(text) == [
        r"Run & Measure & x\_1 \\",
        r"\midrule",
        r"a\&b & S & \textbf{$-$1} \\",
        r" & T & 2 \\",
        r"\addlinespace {[}c] & S & 3 \\",
    ]
    assert r"\begin{tabular}{@{}llr@{}}" in text
    assert r"\caption{10 \% of it}" in text
    assert r"\label{tab:x}" in text
    assert [line for line in text.splitlines() if line.startswith(r"\item")] == [
        r"\item {[}1] note",
        r"\item R\&D",
    ]


def test_a_table_without_notes_has_none():
    assert "tablenotes" not in TABLE.to_latex("tab:x", "")


def test_names_that_differ_are_no_groups():
    table = TextTable(["Run"], [["a"], ["b"]])
    assert rows_of(table.to_latex("tab:x", ""))[2:] == [r"a \\", r"b \\"]


def test_columns_are_left_out_by_their_headers():
    table = TABLE.without("Measure")
    assert table.to_markdown().splitlines()[:2] == ["| Run | x_1 |", "| --- | ---: |"]
    assert table.lines[2] == ["[c]", "3"]
