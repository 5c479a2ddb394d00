"""One name, one thing: a public class has a name of its own in lme and runners together."""

import ast
from collections import defaultdict

from tests.places import ROOT

ROOMS = ("lme", "runners")


def test_no_two_public_classes_have_one_name():
    places = defaultdict(list)
    for path in (file for room in ROOMS for file in sorted((ROOT / room).rglob("*.py"))):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(f"{path.relative_to(ROOT)}:{node.lineno}")
    assert len(places) > 300
    assert {name: found for name, found in places.items() if len(found) > 1} == {}
