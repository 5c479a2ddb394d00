"""Signs of life of running trials."""

import threading

from runners.training.storage import Heartbeat

PATIENCE_S = 20


class Storage:
    """Takes signs of life; fails at the second of each trial."""

    def __init__(self):
        self.beats, self.thrice = [], threading.Event()

    def get_heartbeat_interval(self):
        return 0.001

    def record_heartbeat(self, trial_id):
        self.beats.append(trial_id)
        if self.beats.count(trial_id) == 2:
            raise ConnectionError
        if self.beats.count(trial_id) == 3:
            self.thrice.set()


def test_a_running_trial_gives_signs_until_it_ends_though_the_storage_fails_meanwhile():
    storage = Storage()
    heartbeat = Heartbeat(storage)
    heartbeat.begin(5)
    assert storage.beats == [5], "the first at once"
    with heartbeat.send_heartbeats():
        assert storage.thrice.wait(PATIENCE_S)
        heartbeat.end(5)
        heartbeat.begin(6)
        storage.thrice.clear()
        before = len(storage.beats)
        assert storage.thrice.wait(PATIENCE_S)
    assert storage.beats[before + 1 :].count(5) == 0


def test_a_journal_takes_none():
    heartbeat = Heartbeat(None)
    heartbeat.begin(5)
    heartbeat.requeue_killed(None)
    with heartbeat.send_heartbeats():
        assert not heartbeat.finds_killed
