"""The fields of the Python reference: of parts and of base classes, with defaults, comments and units."""

from dataclasses import dataclass, field

import lme
from runners.config.reference import ConfigField, as_rst, fields


@dataclass
class Part:
    depth: float = 2.0  # [m] of water


@dataclass
class Base:
    speed: float  # [m/s]


@dataclass
class Whole(Base):
    kind: "str | None" = None  # one | two; see `Part` and a_b
    part: Part = field(default_factory=Part)
    goal: list[float] = field(default_factory=lambda: [1.0, 2.0])
    other: Part | None = None


def test_fields_have_type_default_and_comment():
    assert fields(Whole)[1] == ConfigField("kind", "str | None", "None", "one | two; see `Part` and a_b")
    assert [one.name for one in fields(Whole)] == ["speed", "kind", "part.depth", "goal", "other"]
    by_name = {one.name: one for one in fields(Whole)}
    assert by_name["speed"].default == ""
    assert by_name["speed"].meaning == "[m/s]"
    assert by_name["part.depth"].meaning == "[m] of water"
    assert by_name["goal"].default == "[1.0, 2.0]"


def test_the_table_shows_what_restructured_text_would_read():
    lines = as_rst(fields(Whole))
    assert r"     - one \| two; see `Part` and a\_b" in lines
    assert lines.count("   * - ``kind``") == 1


def test_the_keys_of_a_map_set_are_all_there():
    names = [one.name for one in fields(lme.Barn.Config)]
    assert {"subset", "worlds", "time_limit", "goal_tolerance"} <= {*names}
    assert len(names) == len({*names})
