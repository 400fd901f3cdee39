"""Real streets, held out: photos and panoramas cut to the views that renderings are made of.

What is used, and by which right; nothing of it is in any texture, and no model that textures streets learnt from it:

- panoramas: the four of Toulouse and the three of Strasbourg's second street (Panoramax, Licence Ouverte / CC BY-SA), cut at 30
  to 60 degrees to the street; the translator's checkpoint was chosen by the three, its weights by neither;
- swiss: the test part of the Swiss street photos (CC BY 4.0);
- labelmefacade (non-commercial) and ruemonge2014's val part (no licence stated): for evaluation only, as here.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.look.views import FIELD_OF_VIEW, PITCH, SIZE, TURNED

PANORAMAS = ("panoramas/toulouse_*.jpg", "panoramas/strasbourg_stra_1_*.jpg")
# Views that are cut from a panorama, to both sides, ahead and back; the street runs through its middle.
CUTS = 12
PHOTOS = {
    "swiss": ("streetphotos/swiss/test/*.jpg",),
    "labelmefacade": ("streetphotos/labelmefacade/images/*.jpg",),
    "ruemonge2014": ("facades/ruemonge2014/val/images/*.jpg",),
}


def real_views(data: Path) -> Iterator[tuple[str, np.ndarray]]:
    """Pictures (h, w, 3) uint8 of SIZE, each with the name of its set. Raises SystemExit where a set is not there."""
    for path in real_paths(data, PANORAMAS):
        panorama = read_picture(path)
        for yaw in cut_headings():
            yield "panoramas", perspective(panorama, yaw, PITCH)
    for name, patterns in PHOTOS.items():
        for path in real_paths(data, patterns):
            yield name, fitted(read_picture(path))


def cut_headings() -> np.ndarray:
    """Degrees clockwise from a panorama's middle at which views are cut."""
    turned = np.linspace(*TURNED, CUTS // 4)
    return np.concatenate([turned, -turned, 180 - turned, 180 + turned])


def perspective(panorama: np.ndarray, yaw: float, pitch: float, size: tuple[int, int] = SIZE) -> np.ndarray:
    """A view of size (h, w) out of an equirectangular picture (h, w, 3): yaw in degrees clockwise from its middle, pitch as the
    rise of where it looks."""
    import cv2

    height, width = panorama.shape[:2]
    u, v = panorama_places(yaw, pitch, size)
    # twice as many rays as pixels, averaged: as renderings are made
    x, y = (u * width - 0.5).astype(np.float32), (v * height - 0.5).astype(np.float32)
    dense = cv2.remap(panorama, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
    return cv2.resize(dense, size[::-1], interpolation=cv2.INTER_AREA)


def panorama_places(yaw: float, pitch: float, size: tuple[int, int], samples: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Where the rays of a view meet a panorama, as shares (h, w) of its width and height."""
    height, width = size[0] * samples, size[1] * samples
    focal = width / 2 / np.tan(np.radians(FIELD_OF_VIEW) / 2)
    x = (np.arange(width) + 0.5 - width / 2)[None] / focal
    y = (height / 2 - np.arange(height) - 0.5)[:, None] / focal
    tilt = np.arctan(pitch)
    ahead, up = np.cos(tilt) - y * np.sin(tilt), np.sin(tilt) + y * np.cos(tilt)
    ahead, up = np.broadcast_arrays(ahead, up)
    longitude = np.arctan2(np.broadcast_to(x, (height, width)), np.broadcast_to(ahead, (height, width)))
    latitude = np.arctan2(up, np.hypot(x, ahead))
    return ((longitude + np.radians(yaw)) / (2 * np.pi) + 0.5) % 1.0, 0.5 - latitude / np.pi


def fitted(photo: np.ndarray, size: tuple[int, int] = SIZE) -> np.ndarray:
    """The middle of a photo in the shape of a view, reduced to its size."""
    import cv2

    height, width = photo.shape[:2]
    share = min(height / size[0], width / size[1])
    rows, columns = round(size[0] * share), round(size[1] * share)
    top, left = (height - rows) // 2, (width - columns) // 2
    cut = photo[top : top + rows, left : left + columns]
    return cv2.resize(cut, size[::-1], interpolation=cv2.INTER_AREA)


def real_paths(data: Path, patterns: tuple[str, ...]) -> list[Path]:
    """The pictures of a set. Raises SystemExit where there are none."""
    found = sorted(path for pattern in patterns for path in data.glob(pattern))
    if not found:
        raise SystemExit(
            f"benchmarks.look: {data / patterns[0]} names no picture; give the folder of real data by --data"
        )
    return found


def read_picture(path: Path) -> np.ndarray:
    """A picture (h, w, 3) uint8."""
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"))
