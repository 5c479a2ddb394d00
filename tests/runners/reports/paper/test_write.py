"""The folder of a paper: complete, escaped, and nothing of it if something fails."""

import re

import pytest

from lme.errors import InputError
from runners.reports.paper import methods
from runners.reports.paper.write import Recorded, write_paper
from tests.made_runs import write_run
from tests.runners.reports.paper.conftest import HOSTILE

ESCAPED = (
    r"A\_b \& 50 \% \#1 \$x\$ \textasciitilde{} \textasciicircum{} \textbackslash{}input\{c\} $\Delta$$\omega$ $\pm$ "
    r"-- µ 中 é [d] -{}- \textless{}e\textgreater{}"
)
INPUT = re.compile(r"\\(?:input|includegraphics)(?:\[.*?\])?\{(.*?)\}")


@pytest.fixture(scope="module")
def paper(runs, tmp_path_factory, undrawn):
    folder = tmp_path_factory.mktemp("paper") / "mine"
    return folder, [str(path) for path in write_paper(Recorded.read([runs]), folder)]


def text_of(paper, name):
    return (paper[0] / name).read_text(encoding="utf-8")


def test_everything_is_there(paper):
    assert paper[1] == [
        *(f"figures/{name}.pdf" for name in ("ablation", "outcomes", "paths", "worlds")),
        "main.tex", "methods.md", "methods.tex", "references.bib", "reproduce.sh",
        *(f"tables/ablation.{ending}" for ending in ("csv", "md", "tex")),
        "tables/compare.csv", "tables/compare.md", "tables/compare.tex", "tables/compare_worlds.csv",
        *(f"tables/results.{ending}" for ending in ("csv", "md", "tex")),
    ]  # fmt: skip


def test_the_document_has_every_table_and_figure_and_no_other(paper):
    used = set(INPUT.findall(text_of(paper, "main.tex")))
    made = {name.rpartition(".")[0] for name in paper[1] if name.endswith((".tex", ".pdf"))}
    assert used == made - {"main"}


def test_names_are_escaped_and_commands_stay(paper):
    for name in ("tables/results.tex", "tables/compare.tex", "methods.tex"):
        assert ESCAPED in text_of(paper, name).replace("$-$", "")
    assert HOSTILE in text_of(paper, "methods.md")
    assert r"~\cite{lme-paper}" in text_of(paper, "methods.tex")
    for name in paper[1]:
        if name.endswith(".tex"):
            text = re.sub(r"\\[{}]", "", text_of(paper, name))
            assert text.count("{") == text.count("}")
            assert len(re.findall(r"(?<!\\)\$", text)) % 2 == 0
            assert set(re.findall(r"\\begin\{(.*?)\}", text)) == set(re.findall(r"\\end\{(.*?)\}", text))


def test_a_caption_says_worlds_runs_seed_test_and_version(paper):
    for name in ("compare", "ablation"):
        (caption,) = re.findall(r"\\caption\{(.*)\}", text_of(paper, f"tables/{name}.tex"))
        for words in (r"2 worlds $\times$ 1 run", "seed 0", "sign-flip permutation tests", "Holm", "lme 0."):
            assert words in caption


def test_letters_of_other_scripts_have_a_name_for_pdftex(paper):
    assert r"\DeclareUnicodeCharacter{4E2D}{[U+4E2D]}" in text_of(paper, "main.tex")


def test_a_single_run_is_not_compared(runs, tmp_path, undrawn):
    names = {path.name for path in write_paper(Recorded.read([runs / "0"]), tmp_path / "one")}
    assert {"results.tex", "paths.pdf"} <= names
    assert not {"compare.tex", "outcomes.pdf"} & names


def test_nothing_is_left_of_a_paper_that_fails(runs, tmp_path, undrawn, monkeypatch):
    monkeypatch.setattr(methods, "citation_file", lambda: tmp_path / "CITATION.cff")
    with pytest.raises(InputError, match="CITATION"):
        write_paper(Recorded.read([runs / "0"]), tmp_path / "papers" / "mine")
    assert list((tmp_path / "papers").iterdir()) == []


def test_a_folder_with_something_in_it_stays_as_it_is(runs, tmp_path):
    (tmp_path / "mine.tex").touch()
    recorded = Recorded.read([runs / "0"])
    with pytest.raises(InputError, match="exists already"):
        write_paper(recorded, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.tex"]


def test_runs_that_share_no_world_have_tables_and_a_warning(runs, tmp_path, undrawn, says):
    write_run(tmp_path / "other", worlds=(3,))
    recorded = Recorded.read([runs / "0", tmp_path / "other"])
    with says.warns(match="no comparison"):
        names = {path.name for path in write_paper(recorded, tmp_path / "paper")}
    assert "results.tex" in names
    assert "compare.tex" not in names


def test_it_is_the_same_each_time(runs, tmp_path, undrawn):
    for name in ("one", "two"):
        write_paper(Recorded.read([runs]), tmp_path / name)
    for path in (tmp_path / "one").rglob("*.*"):
        assert path.read_bytes() == (tmp_path / "two" / path.relative_to(tmp_path / "one")).read_bytes()
