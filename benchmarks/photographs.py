"""Photos of a flat facade over a street and under a sky, by seeded cameras."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SIDES = (1000, 1500)
HALF_FILM = 21.63  # mm, half the diagonal of 35 mm film


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
