"""What a scan cannot be, and what it may be however odd it looks."""

import math

import numpy as np
import pytest

from lme.errors import InputError
from lme.perception.scan_check import ScanTally, scan_faults
from lme.types import LaserScan

DEGREE = math.radians(1.0)
OPEN = math.inf


def room(beams=360, increment=DEGREE, angle_min=-math.pi, scale=1.0, limits=(0.1, 12.0), far=OPEN):
    """A wall 1 m to the left of the lidar, `far` elsewhere; every number times `scale` but the limits."""
    bearings = angle_min + increment * np.arange(beams)
    with np.errstate(divide="ignore"):
        ranges = 1.0 / np.sin(bearings)
    seen = (ranges > 0.0) & (ranges < 10.0)
    return LaserScan(
        np.where(seen, scale * ranges, far).astype(np.float32), angle_min, increment, *map(float, limits)
    )


def last_angle(scan):
    return scan.angle_min + (len(scan.ranges) - 1) * scan.angle_increment


def faults(scan, angle_max=None, used=None, outline=0.2):
    found = scan_faults(
        scan, used or scan, last_angle(scan) if angle_max is None else angle_max, outline=outline
    )
    return {fault.kind: fault.blind for fault in found}


RIGHT = {
    "a full circle": room(),
    "the first beam again": room(361),
    "clockwise": room(angle_min=math.pi, increment=-DEGREE),
    "narrow": room(41, angle_min=math.pi / 4),
    "four sonars": LaserScan(np.array([1.0, 2.0, 3.0, 4.0], np.float32), 0.0, math.pi / 2, 0.1, 12.0),
    "nothing within range": room()._replace(ranges=np.full(360, OPEN, np.float32)),
    "nothing within range, by a code": room()._replace(ranges=np.full(360, 65.533, np.float32)),
    "codes of a SICK beyond range_max": room(limits=(0.0, 8.0), far=81.91),
    "no return as 0": room(far=0.0),
    "no return as NaN": room(far=math.nan),
    "no return as 1 mm": room(far=0.001),
    "a lidar that reports beyond its range_max": room(limits=(0.1, 2.0)),
    "the robot's own posts below range_min": room(far=0.15, limits=(0.2, 12.0)),
    "a lidar of 200 m": room(limits=(0.5, 200.0), far=60.0),
}


@pytest.mark.parametrize("scan", RIGHT.values(), ids=RIGHT)
def test_what_real_lidars_send_is_plausible(scan):
    assert faults(scan) == {}


@pytest.mark.parametrize("beyond", [-1, 0, 1])
def test_angle_max_may_be_the_last_beam_or_the_next(beyond):
    scan = room()
    assert faults(scan, last_angle(scan) + beyond * DEGREE) == {}
    assert faults(scan, last_angle(scan) - math.tau) == {}
    assert faults(scan, math.nan) == {}


@pytest.mark.parametrize(
    "angles",
    [(-180.0, 1.0, 360), (0.0, 1.0, 360), (-135.0, 0.25, 1081), (-math.pi, 1.0, 360), (-45.0, 0.01, 91)],
)
def test_angles_in_degrees_are_refused(angles, says):
    first, increment, beams = angles
    scan = LaserScan(np.ones(beams, np.float32), first, increment, 0.1, 12.0)
    with says.raises(InputError):
        scan_faults(scan, scan)


IMPLAUSIBLE = {
    "two turns": (room(720), "turns", True),
    "a narrow lidar in degrees": (LaserScan(np.ones(31, np.float32), 0.0, 0.5, 0.1, 12.0), "turns", True),
    "a few beams beyond a turn": (room(370), "overlap", False),
    "millimetres": (room(scale=1000.0, limits=(100.0, 12000.0)), "unit", True),
    "millimetres with limits in metres": (room(scale=1000.0), "unit", True),
    "centimetres": (room(scale=100.0, limits=(0.0, 1200.0)), "unit", True),
    "centimetres with limits in metres": (room(scale=100.0), "unit", True),
    "limits in millimetres": (room(limits=(100.0, 12000.0)), "range_min", True),
    "range_max in millimetres": (room(limits=(0.1, 12000.0)), "range_max", False),
    "range_min above some returns": (room(limits=(1.2, 12.0)), "below range_min", False),
    "range_min above most returns": (room(limits=(3.0, 12.0)), "below range_min", True),
    "all NaN": (room()._replace(ranges=np.full(360, math.nan, np.float32)), "empty", True),
    "all 0": (room()._replace(ranges=np.zeros(360, np.float32)), "empty", True),
    "all below range_min": (room()._replace(ranges=np.full(360, 0.01, np.float32)), "empty", True),
    "all the same": (room()._replace(ranges=np.full(360, 5.0, np.float32)), "constant", False),
}


@pytest.mark.parametrize(("scan", "kind", "blind"), IMPLAUSIBLE.values(), ids=IMPLAUSIBLE)
def test_what_no_lidar_sends_is_a_fault(scan, kind, blind):
    assert faults(scan)[kind] is blind


@pytest.mark.parametrize(
    ("angle_max", "blind"), [(math.radians(184.0), False), (0.0, False), (math.radians(269.5), True)]
)
def test_an_angle_max_that_contradicts_the_increment(angle_max, blind):
    assert faults(room(), angle_max) == {"angle_max": blind}


@pytest.mark.parametrize("said", [0.0, math.inf, math.nan])
def test_a_range_max_that_the_driver_does_not_say(said):
    scan = room()
    found = scan_faults(scan._replace(range_max=said), scan)
    assert [fault.kind for fault in found] == ["range_max"]
    assert "12 m" in found[0].text


def test_the_text_has_the_numbers(says):
    (fault,) = scan_faults(room(720), room(720))
    says(fault.text)


def test_readings_on_the_robot_itself_are_not_lost():
    scan = room(limits=(1.2, 12.0))
    assert faults(scan, outline=1.3) == {}


def test_a_tally_counts_beams_and_scans_without_a_return(says):
    tally = ScanTally()
    tally.add(LaserScan(np.array([1.0, math.nan, math.inf, 0.0, 0.01, 12.0]), 0.0, 0.1, 0.1, 12.0))
    tally.add(LaserScan(np.array([math.inf, math.inf]), 0.0, 0.1, 0.1, 12.0))
    says(tally)
