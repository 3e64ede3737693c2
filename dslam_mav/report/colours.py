"""The colour map of the field, and images as data URIs: nothing but numpy and zlib.

The map runs from almost white through yellow and orange to red. It is built in Oklab (B. Ottosson, 2020) with
evenly falling lightness, so equal steps of the field look equal, and it keeps its order in print and for
colour-blind eyes; ink and blue drawn over it stay readable, which a map ending in black would not allow.
"""

from __future__ import annotations

import base64
import struct
import zlib

import numpy as np
from numpy.typing import NDArray

# lightness, chroma and hue (degrees) along the map
_LIGHTNESS = (0.985, 0.56)
_STOPS = np.array([0.0, 0.12, 0.35, 0.65, 1.0])
_CHROMA = np.array([0.008, 0.055, 0.125, 0.155, 0.185])
_HUE_DEG = np.array([100.0, 95.0, 78.0, 54.0, 30.0])

_OKLAB_TO_LMS = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_LMS_TO_RGB = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


def palette() -> NDArray[np.uint8]:
    """(256, 3) sRGB, evenly spaced in Oklab along the map."""
    fine = np.linspace(0.0, 1.0, 2048)
    lightness = np.interp(fine, [0.0, 1.0], _LIGHTNESS)
    chroma, hue = np.interp(fine, _STOPS, _CHROMA), np.radians(np.interp(fine, _STOPS, _HUE_DEG))
    lab = np.stack([lightness, chroma * np.cos(hue), chroma * np.sin(hue)], axis=1)
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(lab, axis=0), axis=1))])
    even = np.interp(np.linspace(0.0, length[-1], 256), length, fine)
    lab = np.stack([np.interp(even, fine, column) for column in lab.T], axis=1)
    linear = np.clip((lab @ _OKLAB_TO_LMS.T) ** 3 @ _LMS_TO_RGB.T, 0.0, 1.0)
    srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)
    return np.asarray(np.round(255.0 * srgb), dtype=np.uint8)


def image_uri(level: NDArray[np.float64]) -> str:
    """A PNG data URI of `level` (rows, columns), 0 to 1, top row first, in the colours of the map."""
    index = np.round(255.0 * np.clip(np.nan_to_num(level), 0.0, 1.0)).astype(np.uint8)
    return "data:image/png;base64," + base64.b64encode(_png(index)).decode("ascii")


def colour_bar_uri() -> str:
    """The map itself as a strip, low to high."""
    return image_uri(np.linspace(0.0, 1.0, 256)[None, :])


def _png(index: NDArray[np.uint8]) -> bytes:
    """An indexed PNG (ISO/IEC 15948); rows as differences to the row above, so a smooth field packs well."""
    rows, columns = index.shape
    above = np.vstack([np.zeros((1, columns), dtype=np.uint8), index[:-1]])
    filtered = np.hstack([np.full((rows, 1), 2, dtype=np.uint8), index - above])
    return b"".join(
        [
            b"\x89PNG\r\n\x1a\n",
            _chunk(b"IHDR", struct.pack(">IIBBBBB", columns, rows, 8, 3, 0, 0, 0)),
            _chunk(b"PLTE", palette().tobytes()),
            _chunk(b"IDAT", zlib.compress(filtered.tobytes(), 9)),
            _chunk(b"IEND", b""),
        ]
    )


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
