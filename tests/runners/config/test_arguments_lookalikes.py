"""Slips of typing: one line that names the word and what would be right. Names of files may hold any character."""

import re

import pytest

from lme.errors import InputError
from runners.config.arguments import check_words


@pytest.mark.parametrize(
    ("words", "right"),
    [
        (["seed=", "3"], "seed=3"),
        (["seed", "=", "3"], "seed=3"),
        (["seed", "=3"], "seed=3"),
        (["seed:3"], "seed=3"),
        (["map.margin=\u22120.1"], "map.margin=-0.1"),
        (["x=1e\u20133"], "x=1e-3"),
        (["x=range(\u20131,3)"], "x=range(-1,3)"),
        (["x={a:\u22121}"], "x={a:-1}"),
        (["x=1,\u22122"], "x=1,-2"),
        (["\u2013m"], "-m"),
        (["\u2014multirun"], "--multirun"),
        (["seed=\uff13"], "seed=3"),
        (["\uff53eed=3"], "seed=3"),
        (["seed\uff1d3"], "seed=3"),
        (["map=\u201cbarn\u201d"], 'map="barn"'),
        (["map=\u2018barn\u2019"], "map='barn'"),
        (["map=barn\u00a0"], "map=barn"),
        (["\u00a0map=barn"], "map=barn"),
        (["robot=go2\u200b"], "robot=go2"),
    ],
)
def test_a_slip_is_named_with_what_would_be_right(words, right):
    with pytest.raises(InputError, match=re.escape(f"write {right}") + "$") as caught:
        check_words(["map=empty", *words])
    assert words[0].strip() in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "word",
    [
        "map.path=h\u00f6hle\u20131.yaml", "map.path=/a/\u201cb\u201d/c.yaml", "name=\u0394\u03c9", "name=",
        "map.path=C:\\x", "guide.criteria={a:b}", "~space", "map@training.x=barn", "seed=3",
    ],
)  # fmt: skip
def test_what_is_meant_so_passes(word):
    check_words([word, "runs=1"])
