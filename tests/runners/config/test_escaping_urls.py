"""No password of a URL is shown, however it is written, and the rest of the URL is."""

import pytest

from runners.config.escaping import fault_of_password, masked, masked_text, masked_values, reveals_password

NASTY = (
    "secret",
    "p@ss/w#1",
    "p%40",
    "p:ss",
    "p?x=y",
    "p?token=y",
    'q"uo',
    "it's",
    "a b",
    "@",
    "//",
    "p@host:1/x@",
)


@pytest.mark.parametrize("password", NASTY)
@pytest.mark.parametrize("scheme", ["postgresql://me", "redis://", "https://me", "postgresql:/me"])
def test_a_password_is_masked(scheme, password):
    url = f"{scheme}:{password}@host:5/db"
    assert masked(url) == f"{scheme}:***@host:5/db"
    assert masked(masked(url)) == masked(url)
    assert masked_text(f"key={url}: cannot be used") == f"key={scheme}:***@host:5/db: cannot be used"


@pytest.mark.parametrize(
    ("url", "shown"),
    [
        ("postgresql://host:5/db?user=me&password=p@ss w", "postgresql://host:5/db?user=me&password=***"),
        ("http://token@host:5000", "http://***@host:5000"),
        ("me:secret@host/db", "me:***@host/db"),
        ("sqlite:///home/a@b/x.db", "sqlite:///home/a@b/x.db"),
        ("http://127.0.0.1:5000", "http://127.0.0.1:5000"),
        ("postgresql://me@host/db", "postgresql://me@host/db"),
    ],
)
def test_other_places_of_a_password_are_masked_and_what_is_none_stays(url, shown):
    assert masked(url) == shown


def test_what_follows_a_masked_url_stays():
    said = "storage is postgresql://me:***@host/x: escape @ as %40"
    assert masked_text(said) == said
    assert masked_values({"a": ["redis://:x@h", 1], "b": None}) == {"a": ["redis://:***@h", 1], "b": None}


@pytest.mark.parametrize("password", NASTY[1:2] + NASTY[3:])
def test_what_a_driver_says_of_a_url_that_it_cut_at_a_wrong_place_is_hidden(password):
    url = f"postgresql://me:{password}@host/db"
    assert fault_of_password(url).startswith("the password must be escaped: ")
    assert reveals_password("anything", url)


def test_what_a_driver_says_of_a_right_url_is_shown_unless_it_holds_the_password():
    url = "postgresql://me:p%40ss@host/db"
    assert not reveals_password("connection refused", url)
    assert reveals_password("user me, password p@ss", url)
    assert not reveals_password("connection refused", "postgresql://me@host/db")
