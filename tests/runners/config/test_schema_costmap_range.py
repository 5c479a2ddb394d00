"""The key `costmap_range`: which maps it widens, and that it changes no other."""

import pytest

from tests.composing import jobs_of

SMALL = ["map.worlds=[0]", "runs=1", "executor=serial", "tracking=none"]


def ranges(*words):
    with jobs_of("eval", *SMALL) as job:
        costmap = job(*words).config.guide["costmap"]
    return costmap["obstacle_range"], costmap["raytrace_range"]


@pytest.mark.parametrize(
    ("system", "own"), [("kul_fm_tuned", (2.5, 3.0)), ("move_base", (2.5, 3.0)), ("lics", (4.5, 5.0))]
)
def test_maps_of_scans_have_their_own_ranges_unless_told(system, own):
    assert ranges(f"system={system}") == own
    assert ranges(f"system={system}", "costmap_range=8") == (8.0, 8.0)
    assert ranges(f"system={system}", "costmap_range=8", "guide.costmap.raytrace_range=9") == (8.0, 9.0)


def test_it_is_named_as_a_change_where_there_is_a_map():
    with jobs_of("eval", *SMALL) as job:
        ranges = {"guide.costmap.obstacle_range": 8.0, "guide.costmap.raytrace_range": 8.0}
        assert ranges.items() <= job("system=kul_fm_tuned", "costmap_range=8").changes.items()
        assert not ranges.keys() & job("system=kul_fm_tuned").changes.keys()
        assert not ranges.keys() & job("system=lme", "costmap_range=8").changes.keys()


def test_buildings_and_the_cold_trial_let_maps_reach_as_far_as_lme_plus_remembers():
    for words in (["experiment=buildings", "map=building", "map.paths=[x]"], ["experiment=cold_trial"]):
        with jobs_of("eval", "runs=1", "executor=serial", "tracking=none", "hydra.mode=RUN") as job:
            reach = job(*words, "system=lme_plus").config.guide["reach"]
            assert job(*words, "system=kul_fm_tuned").config.guide["costmap"]["obstacle_range"] == reach
