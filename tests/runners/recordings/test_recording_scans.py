"""The scan that stands for a recording: the usual one, whatever the first is."""

import math
import warnings

import numpy as np
import pytest

pytest.importorskip("rosbags")

from lme.live.frames import FramesConfig
from lme.live.messages import LASER_SCAN
from runners.recordings.bags import Bag
from runners.recordings.posed_scans import PosedScans
from runners.recordings.recording import inspect
from runners.recordings.topics import BagTopicsConfig, choose
from tests.made_bags import BEGAN, SECOND, drive

DEGREE = math.radians(1.0)
SCANS = 60


def replaced(folder, scan):
    """A recording whose scan number k is (ranges, angle_min, increment, frame), as `scan` says."""
    made = drive(steps=SCANS)
    made.messages = [one for one in made.messages if one[1] != "/scan"]
    for k in range(SCANS):
        ranges, first, increment, frame = scan(k)
        stamp = BEGAN + k * SECOND // 10
        message = made.scan(stamp, ranges, first, increment)
        message.header.frame_id = frame
        made.add("/scan", LASER_SCAN, stamp, message)
    return made.write(folder)


def of(beams, increment=DEGREE, first=-math.pi, frame="laser"):
    return np.linspace(1.0, 2.0, beams), first, increment, frame


def inspected(path):
    """The beams of the usual scan, and every scan that is left in."""
    with Bag(path) as bag:
        topics = choose(bag, BagTopicsConfig(), None)
        recording = inspect(bag, topics, FramesConfig(), "auto")
        posed = PosedScans(recording, SECOND)
        for message in bag.messages(topics.names):
            posed.take(message)
        return len(recording.first_scan.content.ranges), [
            len(one.message.content.ranges) for one in posed.ready(None)
        ]


FIRST = {
    "one short": lambda k: of(90 if k < 1 else 360),
    "many short": lambda k: of(90 if k < 25 else 360),
    "half of all short": lambda k: of(90 if k % 2 else 360),
    "one of two turns": lambda k: of(720 if k < 1 else 360),
    "one finer": lambda k: of(1440, DEGREE / 4) if k < 1 else of(360),
    "clockwise and short": lambda k: of(90 if k < 3 else 360, -DEGREE, math.pi),
    "one wide by mistake": lambda k: of(360 if k > 1 else 400),
}


@pytest.mark.parametrize("scan", FIRST.values(), ids=FIRST)
def test_a_first_scan_of_another_size_does_not_set_the_geometry(tmp_path, scan):
    beams, left_in = inspected(replaced(tmp_path, scan))
    assert beams == 360
    assert len(left_in) == SCANS


def test_a_lidar_whose_number_of_beams_varies_has_the_widest(tmp_path):
    beams, _ = inspected(replaced(tmp_path, lambda k: of(350 + 7 * k % 10)))
    assert beams >= 358


def test_scans_of_another_lidar_are_left_out(tmp_path, says):
    def scan(k):
        return of(181, first=-math.pi / 2, frame="rear") if k % 3 == 0 else of(360)

    with says.warns():
        beams, left_in = inspected(replaced(tmp_path, scan))
    assert beams == 360
    assert left_in == [360] * (SCANS * 2 // 3)


@pytest.mark.parametrize("few", [0, 1])
def test_scans_of_hardly_a_beam_are_left_out(tmp_path, few, says):
    with says.warns():
        beams, left_in = inspected(replaced(tmp_path, lambda k: of(few if k < 4 else 360)))
    assert (beams, left_in) == (360, [360] * (SCANS - 4))


def test_of_a_recording_whose_scans_are_alike_it_is_the_first(tmp_path):
    with warnings.catch_warnings(), Bag(drive().write(tmp_path)) as bag:
        warnings.simplefilter("error")
        recording = inspect(bag, choose(bag, BagTopicsConfig(), None), FramesConfig(), "auto")
        assert recording.first_scan.recorded == min(m.recorded for m in bag.messages(["/scan"]))
