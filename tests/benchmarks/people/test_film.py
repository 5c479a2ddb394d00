"""A film of tracked people."""

import math
from pathlib import Path

import numpy as np
from PIL import Image

from benchmarks.people import film
from tests.benchmarks.people.test_labels import recording


def test_a_film_shows_every_scan_of_the_part_and_the_tracks(tmp_path, monkeypatch):
    places = np.column_stack([np.full(30, 3.0), np.linspace(-2.0, 2.0, 30)])
    made = recording(places)
    monkeypatch.setattr(film, "read", lambda path: made)
    to = tmp_path / "people.gif"
    film.film(Path("people.bag"), 1.0, math.inf, to)
    with Image.open(to) as opened:
        assert opened.n_frames == 20
        opened.seek(15)
        picture = np.asarray(opened.convert("RGB")).astype(int)
    coloured = np.ptp(picture, axis=2) > 60  # the track; everything else is grey
    assert coloured.sum() > 100
