"""The settings of the live driver."""

import pytest

from lme.errors import InputError
from lme.live.config import LiveConfig


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("stale", 0.0),
        ("clock", "sundial"),
        ("seed", -1),
    ],
    ids=str,
)
def test_a_mistake_in_the_config_is_one_line(key, value, says):
    with says.raises(InputError):
        LiveConfig(**{key: value})
