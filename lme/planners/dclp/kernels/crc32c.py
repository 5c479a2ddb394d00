"""CRC-32C, the checksum of LevelDB tables and TensorFlow checkpoints."""

import numpy as np
from numba import njit
from numpy.typing import NDArray

_POLYNOMIAL = 0x82F63B78  # Castagnoli, bits reversed (RFC 3720, appendix B.4)


def _table() -> NDArray[np.uint32]:
    """Return the effect of each byte on the checksum: (256,)."""
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ np.uint32(_POLYNOMIAL), table >> 1).astype(np.uint32)
    return table


_TABLE = _table()


def crc32c(data: bytes) -> int:
    """Checksum of `data`, as in RFC 3720."""
    return int(_crc32c(np.frombuffer(data, np.uint8)))


@njit(cache=True)
def _crc32c(data):
    crc = np.uint32(0xFFFFFFFF)
    for byte in data:
        crc = _TABLE[(crc ^ byte) & np.uint32(0xFF)] ^ (crc >> np.uint32(8))
    return crc ^ np.uint32(0xFFFFFFFF)
