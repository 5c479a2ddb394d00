import pytest
from hypothesis import given
from hypothesis import strategies as st

from lme.planners.dclp.kernels.crc32c import crc32c
from tests import oracles


@pytest.mark.parametrize(
    ("data", "checksum"),
    [
        (b"", 0),
        (b"123456789", 0xE3069283),
        (bytes(32), 0x8A9136AA),  # RFC 3720, appendix B.4, like the next two
        (b"\xff" * 32, 0x62A8AB43),
        (bytes(range(32)), 0x46DD794E),
    ],
)
def test_the_published_checksums_come_out(data, checksum):
    assert crc32c(data) == checksum


@given(st.binary(max_size=100))
def test_equals_the_checksum_bit_by_bit(data):
    assert crc32c(data) == oracles.crc32c(data)
