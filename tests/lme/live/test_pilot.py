"""Before a robot drives, everything that a decision runs has been loaded."""

import numpy as np
import pytest

pytest.importorskip("rosbags")

from lme.live.config import ScanConfig
from lme.live.pilot import Pilot
from lme.live.scan_source import ScanSource
from lme.navigation.navigator import Navigator
from lme.perception.people.source import TrackedPeople
from lme.perception.people.tracker import PeopleTracker
from tests import builders
from tests.lme.live.rig import Puppet
from tests.made_bags import BagMaker


def test_a_tracker_of_people_works_while_the_pilot_warms_up(monkeypatch):
    """It registers scans and remembers what stands from the second scan on, and after 0.6 s."""
    people, steps = TrackedPeople(builders.stage()), []
    update = PeopleTracker.update

    def noted(tracker, scan, odometry, dt):
        steps.append(dt)
        return update(tracker, scan, odometry, dt)

    monkeypatch.setattr(PeopleTracker, "update", noted)
    puppet = Puppet()
    scan = BagMaker().scan(0, np.full(540, 3.0), -np.pi, 2 * np.pi / 540, (0.02, 15.0))
    source = ScanSource(ScanConfig(), scan, np.eye(4), builders.stage())
    Pilot(source, Navigator(puppet, puppet, people=people), 0, lambda: 0).warm_up(scan)
    assert len(steps) > 2
    assert min(steps) > 0.0
    assert sum(steps[1:]) > 0.6
    assert max(steps) <= 1.0
