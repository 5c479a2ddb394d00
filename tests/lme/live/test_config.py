"""The settings of the live driver."""

import pytest

from lme.errors import InputError
from lme.live.config import LiveConfig


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("stale", 0.0, "stale is 0: must be greater than 0"),
        ("clock", "sundial", "clock is 'sundial': must be one of header, received"),
        ("seed", -1, "seed is -1"),
    ],
)
def test_a_mistake_in_the_config_is_one_line(key, value, message):
    with pytest.raises(InputError, match=message) as error:
        LiveConfig(**{key: value})
    assert "\n" not in str(error.value)
