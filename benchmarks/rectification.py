"""Photos rectified against known cameras: `python -m benchmarks.rectification --data DIR` prints one JSON object.

Facades of ecp, artdeco and cmp, which are rectified, hang as planes over a street and under a sky, seen by seeded cameras:
24 to 50 mm, turned by up to 45 and tilted by up to 25 degrees, rolled a little, with sensor noise and radial distortion. Each
photo is rectified with its focal length given, as EXIF does, and without. axis_error: degrees between where the facade's true
horizontal and vertical go and the image's axes, the mean over what the photo shows of the facade, the worse axis. aspect_error:
of width over height. refused: photos that `rectify` refuses; wild: results more than 5 degrees or 30 % off. kept: share of the
facade's visible part that the result holds; facade: share of the result that is facade. Thresholds were chosen on the facades
of even place in each set's list; the figures are of those of odd place.

floor: what `rectify` makes of the facades as they are, which are not rectified perfectly; it is part of the errors above.
ruemonge2014: street photos with label maps; skew is the median angle in degrees, by length, of windows' borders to the axes.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from facade_core.core.errors import ImageError
from facade_core.imagery.rectify.photo import Rectified, rectify

SETS = ("ecp", "artdeco", "cmp")
SIDES = (1000, 1500)
HALF_FILM = 21.63  # mm, half the diagonal of 35 mm film
STOREYS_M = 18.0  # height of each facade
WILD_DEG, WILD_ASPECT = 5.0, 0.3
BORDERS = (1, 4)  # RueMonge's windows and doors


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera before a facade, whose plane is z = 0, x right and y down in metres from its middle, z away from the viewer.

    rotation (3, 3) world to camera; position (3,); focal in pixels; distortion: x = u (1 + k r^2), r in focal lengths; size of
    its photos (height, width).
    """

    rotation: np.ndarray
    position: np.ndarray
    focal: float
    distortion: float
    size: tuple[int, int]

    def project(self, points: np.ndarray) -> np.ndarray:
        """Photo pixels (..., 2) of world points (..., 3); NaN behind the camera."""
        local = (points - self.position) @ self.rotation.T
        flat = local[..., :2] / np.where(local[..., 2:] > 0.01, local[..., 2:], np.nan)
        bent = flat * (1 + self.distortion * (flat**2).sum(axis=-1, keepdims=True))
        return bent * self.focal + (np.array(self.size[::-1]) - 1) / 2

    def rays(self) -> np.ndarray:
        """World directions (H, W, 3) of the photo's pixels."""
        y, x = np.mgrid[: self.size[0], : self.size[1]].astype(np.float32)
        x, y = (x - (self.size[1] - 1) / 2) / self.focal, (y - (self.size[0] - 1) / 2) / self.focal
        bent = factor = np.sqrt(x * x + y * y)
        for _ in range(6):
            factor = bent / (1 + self.distortion * factor * factor)
        flat = factor / np.maximum(bent, 1e-9)
        return np.stack([x * flat, y * flat, np.ones_like(x)], axis=-1) @ self.rotation.astype(np.float32)


def camera(chance: np.random.Generator, width: float, height: float) -> Camera:
    """A camera that has most of a facade of this size (metres) in view."""
    from scipy.spatial.transform import Rotation

    size = SIDES if width > height else SIDES[::-1]
    focal = np.exp(chance.uniform(np.log(24), np.log(50))) / HALF_FILM * np.hypot(*size) / 2
    yaw, pitch = chance.uniform(-45, 45), chance.uniform(-25, 25)
    turned = Rotation.from_euler("zxy", [chance.normal(0, 2), pitch, yaw], degrees=True).as_matrix()
    bend = chance.uniform(-0.03, 0.03)
    aim = np.array([chance.uniform(-0.1, 0.1) * width, chance.uniform(-0.1, 0.1) * height, 0.0])
    corners = np.array([[x, y, 0.0] for x in (-width / 2, width / 2) for y in (-height / 2, height / 2)])
    fill = chance.uniform(0.85, 1.1)
    near, far = 1.0, 500.0
    for _ in range(40):
        distance = (near + far) / 2
        seen = Camera(turned, aim - turned[2] * distance, focal, 0.0, size).project(corners) / size[::-1] - 0.5
        fits = np.isfinite(seen).all() and np.abs(seen).max() <= fill / 2
        near, far = (near, distance) if fits else (distance, far)
    return Camera(turned, aim - turned[2] * far, focal, bend, size)


def photograph(
    facade: np.ndarray, view: Camera, width: float, height: float, chance: np.random.Generator
) -> np.ndarray:
    """What the camera sees: (H, W, 3) uint8 of the facade (h, w, 3), the street before it and the sky."""
    import cv2

    right, down, ahead = np.moveaxis(view.rays(), -1, 0)
    eye = view.position.astype(np.float32)

    def noise(size: tuple[int, ...]) -> np.ndarray:
        return chance.standard_normal(size, np.float32)

    rise = np.clip(-down / np.sqrt(right * right + down * down + ahead * ahead), 0, 1)
    clouds = 12 * cv2.resize(noise((8, 12)), view.size[::-1], interpolation=cv2.INTER_CUBIC)
    sky = np.stack([base + slope * rise + clouds for base, slope in ((150, -70), (180, -60), (225, -30))], axis=-1)
    # The ground lies at the facade's foot, or below the camera where that stands lower: pavement, kerb and road.
    ground = max(height / 2, eye[1] + 1.0)
    away = eye[2] + (ground - eye[1]) / np.maximum(down, 1e-6) * ahead
    street = np.where(away > -3.0, 165.0, 95.0) - 25.0 * (np.abs(away + 3.0) < 0.15)
    street += 40 * cv2.GaussianBlur(noise(view.size), (0, 0), 2.0)
    picture: np.ndarray = np.where((down > 1e-6)[..., None], street[..., None], sky).astype(np.float32)
    depth = -eye[2] / np.maximum(ahead, 1e-6)
    x, y = eye[0] + depth * right, eye[1] + depth * down
    on = (np.abs(x) <= width / 2) & (np.abs(y) <= height / 2)
    column = np.where(on, (x / width + 0.5) * facade.shape[1] - 0.5, -10).astype(np.float32)
    row = np.where(on, (y / height + 0.5) * facade.shape[0] - 0.5, -10).astype(np.float32)
    wall = cv2.remap(facade, column, row, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
    picture = np.where(on[..., None], wall, picture) + chance.uniform(1, 6) * noise((*view.size, 3))
    return np.clip(picture, 0, 255).round().astype(np.uint8)


def errors(
    view: Camera, homography: np.ndarray, size: tuple[int, int], extent: tuple[float, float]
) -> dict[str, float]:
    """axis_error (degrees), aspect_error, kept and facade of a homography from a camera's photo of a facade of this extent."""
    width, height = extent
    step = 0.002 * height
    across, down = np.meshgrid(np.linspace(-0.49, 0.49, 33) * width, np.linspace(-0.49, 0.49, 33) * height)
    wall = np.stack([across, down, np.zeros_like(across)], axis=-1).reshape(-1, 3)
    photo = view.project(wall)
    wall = wall[((photo >= 0) & (photo <= np.array(view.size[::-1]) - 1)).all(axis=1)]
    middle = _through(homography, view.project(wall))
    inside = ((middle >= -0.5) & (middle <= np.array(size[::-1]) - 0.5)).all(axis=1)
    right, under = (_through(homography, view.project(wall + step * np.eye(3)[axis])) - middle for axis in (0, 1))
    turned = [np.degrees(np.arctan2(right[:, 1], right[:, 0])), np.degrees(np.arctan2(under[:, 0], under[:, 1]))]
    spread = np.concatenate([wall[:, :2], np.ones((len(wall), 1))], axis=1)
    affine = np.linalg.lstsq(spread, middle, rcond=None)[0]
    ratio = np.linalg.norm(affine[0]) / np.linalg.norm(affine[1])
    corners = _through(homography, view.project(np.array([[x, y, 0] for x, y in _around(width, height)])))
    return {
        "axis_error": max(float(np.abs(angle).mean()) for angle in turned),
        "aspect_error": abs(float(ratio) - 1),
        "kept": float(inside.mean()),
        "facade": _share_inside(corners, size),
    }


def measure(photos: Sequence[tuple[str, np.ndarray]], cases: int, *, seed: int = 0) -> dict[str, Any]:
    """Figures of `rectify` with the focal length given and unknown, over photos of facades (name, (h, w, 3))."""
    found: dict[str, list[dict[str, Any]]] = {"focal_given": [], "focal_unknown": []}
    for case in range(cases):
        chance = np.random.default_rng([seed, case])
        name, facade = photos[case % len(photos)]
        height, width = STOREYS_M, STOREYS_M * facade.shape[1] / facade.shape[0]
        view = camera(chance, width, height)
        photo = photograph(facade, view, width, height, chance)
        for variant, focal in (("focal_given", view.focal), ("focal_unknown", None)):
            start = time.perf_counter()
            result = _attempt(photo, focal)
            row: dict[str, Any] = {"case": case, "name": name, "seconds": time.perf_counter() - start}
            if isinstance(result, str):
                row["refusal"] = result
            else:
                row |= errors(view, result.homography, result.image.shape[:2], (width, height))
            found[variant].append(row)
    return {variant: summary(rows) for variant, rows in found.items()}


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Medians and outer percentiles of rows of errors; rows with a refusal count as refused."""
    done = [row for row in rows if "refusal" not in row]
    wild = [row for row in done if row["axis_error"] > WILD_DEG or row["aspect_error"] > WILD_ASPECT]

    def percentiles(key: str, *shares: int) -> list[float | None]:
        return [round(float(np.percentile([row[key] for row in done], p)), 4) if done else None for p in shares]

    return {
        "photos": len(rows),
        "refused": len(rows) - len(done),
        "wild": len(wild),
        "axis_error_deg": dict(zip(("median", "p95"), percentiles("axis_error", 50, 95), strict=True)),
        "aspect_error": dict(zip(("median", "p95"), percentiles("aspect_error", 50, 95), strict=True)),
        "kept": dict(zip(("median", "p5", "least"), percentiles("kept", 50, 5, 0), strict=True)),
        "facade": dict(zip(("median",), percentiles("facade", 50), strict=True)),
        "seconds_per_photo": round(float(np.median([row["seconds"] for row in rows])), 3) if rows else None,
        "refusals": [f"{row['name']} ({row['case']}): {row['refusal']}" for row in rows if "refusal" in row],
        "wild_cases": [f"{row['name']} ({row['case']})" for row in wild],
    }


def floor(photos: Sequence[tuple[str, np.ndarray]]) -> dict[str, Any]:
    """How far `rectify` turns the axes of facades that are rectified already, and changes their aspect."""
    turned, aspect, kept, refused = [], [], [], 0
    for _, facade in photos:
        result = _attempt(facade, None)
        if isinstance(result, str):
            refused += 1
            continue
        height, width = facade.shape[:2]
        x, y = np.meshgrid(np.linspace(0.02, 0.98, 17) * width, np.linspace(0.02, 0.98, 17) * height)
        points = np.stack([x, y], axis=-1).reshape(-1, 2)
        middle = _through(result.homography, points)
        right, under = (_through(result.homography, points + np.eye(2)[axis]) - middle for axis in (0, 1))
        angles = [np.arctan2(right[:, 1], right[:, 0]), np.arctan2(under[:, 0], under[:, 1])]
        turned.append(max(float(np.degrees(np.abs(angle).mean())) for angle in angles))
        affine = np.linalg.lstsq(np.column_stack([points, np.ones(len(points))]), middle, rcond=None)[0]
        aspect.append(abs(float(np.linalg.norm(affine[0]) / np.linalg.norm(affine[1])) - 1))
        inside = (middle >= -0.5) & (middle <= np.array(result.image.shape[1::-1]) - 0.5)
        kept.append(float(inside.all(axis=1).mean()))
    return {
        "facades": len(photos),
        "refused": refused,
        "axis_deg": {"median": round(float(np.median(turned)), 3), "p95": round(float(np.percentile(turned, 95)), 3)},
        "aspect": {"median": round(float(np.median(aspect)), 4), "p95": round(float(np.percentile(aspect, 95)), 4)},
        "kept": {"median": round(float(np.median(kept)), 4), "least": round(min(kept), 4)},
    }


def skew(folder: Path) -> dict[str, Any]:
    """The label borders' skew before and after `rectify`, over RueMonge's photos: medians over photos, and 95th percentile."""
    before, after, refused, seconds = [], [], 0, []
    for path in sorted(folder.glob("*/images/*.jpg")):
        labels = _read(path.parents[1] / "labels" / f"{path.stem}.png", grey=True)
        borders = _borders(labels)
        if len(borders) < 8:
            continue
        start = time.perf_counter()
        result = _attempt(_read(path), None)
        seconds.append(time.perf_counter() - start)
        if isinstance(result, str):
            refused += 1
            continue
        moved = _through(result.homography, borders)
        within = ((moved >= 0) & (moved < np.array(result.image.shape[1::-1]))).all(axis=(1, 2))
        if within.sum() >= 8:
            before.append(_skew(borders[within]))
            after.append(_skew(moved[within]))
    return {
        "photos": len(before),
        "refused": refused,
        "before_deg": {"median": round(float(np.median(before)), 3), "p95": round(float(np.percentile(before, 95)), 3)},
        "after_deg": {"median": round(float(np.median(after)), 3), "p95": round(float(np.percentile(after, 95)), 3)},
        "seconds_per_photo": round(float(np.median(seconds)), 3),
    }


def facades(data: Path, half: int, each: int | None = None) -> list[tuple[str, np.ndarray]]:
    """Facades of even (0) or odd (1) place in their set's list, the sets in turn; each: how many of a set."""
    lists = [sorted((data / "facades" / name / "images").iterdir())[half::2] for name in SETS]
    chosen = [paths[: each or len(paths)] for paths in lists]
    turn = [paths[i % len(paths)] for i in range(max(map(len, chosen))) for paths in chosen]
    return [(f"{path.parts[-3]}/{path.stem}", _read(path)) for path in dict.fromkeys(turn)]


def _attempt(photo: np.ndarray, focal: float | None) -> Rectified | str:
    try:
        return rectify(photo, focal=focal)
    except ImageError as refusal:
        return str(refusal)


def _through(homography: np.ndarray, points: np.ndarray) -> np.ndarray:
    moved = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1) @ homography.T
    return moved[..., :2] / moved[..., 2:]


def _around(width: float, height: float) -> np.ndarray:
    """The facade's outline, as points."""
    edge = np.linspace(-0.5, 0.5, 20)
    side = np.full(20, 0.5)
    sides = [(edge, -side), (side, edge), (-edge, side), (-side, -edge)]
    return np.concatenate([np.column_stack(xy) for xy in sides]) * [width, height]


def _share_inside(outline: np.ndarray, size: tuple[int, int]) -> float:
    """Share of an image that a polygon (n, 2) covers."""
    import cv2

    mask = np.zeros(size, np.uint8)
    if np.isfinite(outline).all():
        cv2.fillPoly(mask, [np.clip(np.round(outline), -30000, 30000).astype(np.int32)], 1)
    return float(mask.mean())


def _borders(labels: np.ndarray) -> np.ndarray:
    """Straight borders (n, 2, 2) of windows and doors in a label map."""
    import cv2

    mask = np.isin(labels, BORDERS).astype(np.uint8) * 255
    found = cv2.createLineSegmentDetector().detect(mask)[0]
    ends = np.empty((0, 2, 2)) if found is None else np.asarray(found, np.float64).reshape(-1, 2, 2)
    return ends[np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) >= 12]


def _skew(borders: np.ndarray) -> float:
    """Median angle in degrees to the nearer axis, by length."""
    step = np.abs(borders[:, 1] - borders[:, 0])
    angle = np.degrees(np.arctan2(step.min(axis=1), step.max(axis=1)))
    order = np.argsort(angle)
    share = np.cumsum(np.linalg.norm(step, axis=1)[order])
    return float(angle[order[np.searchsorted(share, share[-1] / 2)]])


def _read(path: Path, *, grey: bool = False) -> np.ndarray:
    from PIL import Image

    with Image.open(path) as image:
        return np.asarray(image if grey else image.convert("RGB"))


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="Rectify photos taken by known cameras, and photos of a street.")
    parser.add_argument(
        "--data",
        type=Path,
        default=Path(os.environ.get("STREETLOOM_DATA", "../shared/data")),
        help="folder with facades/",
    )
    parser.add_argument("--cameras", type=int, default=200, help="how many cameras (200)")
    options = parser.parse_args(arguments)
    chosen = facades(options.data, 1)
    parts: dict[str, Callable[[], dict[str, Any]]] = {
        "cameras": lambda: measure(chosen, options.cameras),
        "floor": lambda: floor(chosen),
        "ruemonge2014": lambda: skew(options.data / "facades" / "ruemonge2014"),
    }
    print(json.dumps({"benchmark": "rectification"} | {name: part() for name, part in parts.items()}))


if __name__ == "__main__":
    main()
