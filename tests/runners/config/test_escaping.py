"""Hostile text, in every format that it can reach."""

import csv
import io
import json
import os
import re

import pytest

from runners.config.escaping import (
    csv_value,
    html_address,
    html_text,
    json_text,
    latex_text,
    markdown_text,
    plot_text,
    visible,
)

CODES = "a\x1b]0;b\x07\x9b31m\r\n\x7f\u202e\u2066\u200b" + os.fsdecode(b"\xff")


@pytest.mark.parametrize("escape", [visible, html_text, markdown_text, latex_text, csv_value, plot_text])
def test_nothing_hidden_is_left(escape):
    shown = escape(CODES)
    assert shown.replace("\n", "").isprintable()
    shown.encode()
    assert escape("Δω ± 0.5 – LME (ours), no_c_o × täglich 東京") is not None


def test_codes_are_shown():
    assert visible("a\x1b[31m\u202eb") == r"a\x1b[31m\u202eb"
    assert visible("a\nb\t", "\n\t") == "a\nb\t"
    assert visible(os.fsdecode(b"caf\xe9")) == r"caf\udce9"


@pytest.mark.parametrize(
    "text", ["=1+1", "+cmd", "-2+3", "@SUM(A1)", "\t=1", "\r=1", " =1", "＝1", "-", "=", "--x"]
)
def test_a_spreadsheet_reads_no_formula(text):
    file = io.StringIO()
    csv.writer(file).writerow([csv_value(text)])
    (cell,) = next(csv.reader(io.StringIO(file.getvalue())))
    assert cell.startswith("'")


@pytest.mark.parametrize(
    "value", [-0.5, -1, 0.0, None, True, "-0.5", "+1e-3", "-inf", "LME (ours)", "a=b", ""]
)
def test_numbers_and_plain_text_stay_in_a_csv(value):
    assert csv_value(value) is value or csv_value(value) == value


def test_markdown_has_no_markup():
    shown = markdown_text("<script>|`id` [a](http://b) ![i](http://c)\n# H &lt;")
    assert not re.search(r"[<`\n]|\]\(|!\[|&lt;", shown)
    assert markdown_text("p < 0.001 & more") == "p < 0.001 & more"
    assert markdown_text("# H") == "&#35; H"
    assert markdown_text("-0.5") == "-0.5"
    assert markdown_text("|Δω| [rad/s] robot.v_max=1") == "|Δω| [rad/s] robot.v_max=1"


def test_latex_has_no_markup():
    special = {"\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}"}
    special |= {letter: f"\\{letter}" for letter in "$#%&_{}"}
    for letter, escaped in special.items():
        assert latex_text(f"a{letter}b") == f"a{escaped}b"
    assert latex_text(r"\input{x}") == r"\textbackslash{}input\{x\}"
    assert latex_text("[2em] x") == "{[}2em] x"
    assert latex_text("|Δω| [rad/s] 0.850 ± 0.050") == r"$|\Delta\omega|$ [rad/s] 0.850 $\pm$ 0.050"
    assert latex_text("Δ, ω ≤ −2 × 3 – 4") == r"$\Delta$, $\omega$ $\le$ $-$2 $\times$ 3 -- 4"
    assert latex_text('a--b---c "d"') == r"a-{}-b-{}-{}-c \symbol{34}d\symbol{34}"


def test_pictures_and_addresses_and_json():
    assert plot_text("$a$\nb") == "\\$a\\$\nb"
    assert html_address(os.fsdecode(b"a b/\xff.png")) == "a%20b/%FF.png"
    assert html_text("<b>\"'") == "&lt;b&gt;&quot;&#x27;"
    text = {"a": "\x1b\x9b\u202e\U000e0041é"}
    written = json_text(json.dumps(text, ensure_ascii=False))
    assert written.isprintable()
    assert json.loads(written) == text
