"""MeshLab's registered rasters: perspective views of panoramas and pictures without distortion, with their cameras and the
mesh as a project of MeshLab's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np

from benchmarks.inpainting import peers
from facade_core.core.types import Pose
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.geometry.charts import Mesh
from facade_core.geometry.raycast import RayCaster
from facade_core.imagery.panorama_camera import (
    camera_position,
    pixels_per_radian,
    project_directions_to_picture,
)

# Views of a panorama: headings around it, and the field of view of each, degrees.
HEADINGS, FIELD_OF_VIEW_DEG = 8, 90.0
# Heights at which they look, degrees: straight ahead, and up at what is over the street.
PITCHES_DEG = (0.0, 40.0)
# Share of the width of a picture of a lens that its view without distortion and roll has.
LENS_VIEW_SHARE = 0.95
# Longest edge of a face, metres: the filter takes a face from one picture that shows it whole.
MAX_EDGE_M = 1.0


@dataclass(frozen=True, eq=False)
class FaceTexture:
    """Textured mesh.

    Attributes
    ----------
    mesh : mesh whose `chart` is the number of a face.
    uv : (faces, 3, 2) texture coordinates, u right and v up; zeros without a texture.
    image : (h, w, 3) uint8.
    """

    mesh: Mesh
    uv: np.ndarray
    image: np.ndarray

    @cached_property
    def caster(self) -> RayCaster:
        """Return the ray caster of the faces."""
        return RayCaster(self.mesh)

    def sample(self, origin: np.ndarray, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the colours (h, w, 3) uint8 along rays (h, w, 3), and where the mesh has a texture, (h, w) bool."""
        depth, face = self.caster.cast(origin, rays)
        has = (face >= 0) & (self.uv[face] != 0).any(axis=(-1, -2))
        points = origin + np.where(has, depth, 0.0)[..., None] * rays
        corners = self.mesh.vertices[self.mesh.triangles[face]]
        shares = barycentric_shares(corners, points)
        uv = (shares[..., None] * self.uv[face]).sum(axis=-2)
        rows, columns = self.image.shape[:2]
        x, y = uv[..., 0] * columns - 0.5, (1 - uv[..., 1]) * rows - 0.5
        return cv2.remap(self.image, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR), has


def barycentric_shares(corners: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return the shares (..., 3) of the corners (..., 3, 3) of triangles in points (..., 3) on them."""
    a, b = corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    p = points - corners[..., 0, :]
    aa, ab, bb, pa, pb = (np.einsum("...i,...i", *pair) for pair in ((a, a), (a, b), (b, b), (p, a), (p, b)))
    scale = np.maximum(aa * bb - ab * ab, 1e-12)
    second, third = (bb * pa - ab * pb) / scale, (aa * pb - ab * pa) / scale
    return np.stack([1 - second - third, second, third], axis=-1)


def divide_triangles(mesh: Mesh, longest: float) -> Mesh:
    """Divide each triangle evenly until its edges are at most `longest` metres; faces are numbered in `chart`."""
    vertices, triangles, count = [], [], 0
    for corners in mesh.vertices[mesh.triangles]:
        edges = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1)
        n = max(1, int(np.ceil(edges.max() / longest)))
        row, column = np.array([(i, j) for i in range(n + 1) for j in range(n + 1 - i)]).T
        number = np.full((n + 2, n + 2), -1)
        number[row, column] = np.arange(len(row)) + count
        upright = np.stack([number[:-1, :-1], number[1:, :-1], number[:-1, 1:]], axis=-1).reshape(-1, 3)
        inverted = np.stack([number[1:, :-1], number[1:, 1:], number[:-1, 1:]], axis=-1).reshape(-1, 3)
        faces = np.concatenate([upright, inverted])
        triangles.append(faces[(faces >= 0).all(axis=1)])
        shares = np.stack([n - row - column, row, column], axis=1) / n
        vertices.append(shares @ corners)
        count += len(row)
    all_triangles = np.concatenate(triangles).astype(np.int32)
    faces = np.arange(len(all_triangles), dtype=np.int32)
    return Mesh(np.concatenate(vertices), all_triangles, faces, np.zeros(count, np.int32))


def perspective_cameras(pose: Pose, size: int, *, pitches: Sequence[float] = PITCHES_DEG) -> list[PerspectiveCamera]:
    """Return the cameras of views around a panorama, `size` pixels a side."""
    place = camera_position(pose)
    return [
        PerspectiveCamera.from_heading(
            place, heading=number * 360 / HEADINGS, pitch=pitch, field_of_view=FIELD_OF_VIEW_DEG, size=(size, size)
        )
        for pitch in pitches
        for number in range(HEADINGS)
    ]


def raster_cameras(pose: Pose, width: int) -> list[PerspectiveCamera]:
    """Return the cameras of the rasters of a picture so wide, as sharp in the middle of a raster as the picture is."""
    if pose.lens is None:
        return perspective_cameras(
            pose, round(width / pose.view[2] / np.pi * np.tan(np.radians(FIELD_OF_VIEW_DEG) / 2))
        )
    columns = round(LENS_VIEW_SHARE * width)
    angle = 2 * np.degrees(np.arctan(columns / 2 / pixels_per_radian(pose, width)))
    return [
        PerspectiveCamera.from_heading(
            camera_position(pose),
            heading=pose.heading,
            pitch=pose.pitch,
            field_of_view=float(angle),
            size=(round(columns * pose.lens.size[1] / pose.lens.size[0]), columns),
        )
    ]


def cut_view(image: np.ndarray, pose: Pose, rays: np.ndarray) -> np.ndarray:
    """Return what a picture shows along world rays (h, w, 3), as (h, w, channels)."""
    share = project_directions_to_picture(rays, pose)
    left, top, width, height = pose.view
    rows, columns = image.shape[:2]
    x = ((share[..., 0] - left) % 1.0 / width * columns - 0.5).astype(np.float32)
    y = ((share[..., 1] - top) / height * rows - 0.5).astype(np.float32)
    return cv2.remap(image, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)


def shot_attributes(camera: PerspectiveCamera, origin: np.ndarray) -> dict[str, str]:
    """Return a camera as attributes of VCGCamera: axes right, up and back, and minus the centre from `origin` on."""
    forward, right, down, focal = camera.axes()
    matrix = np.eye(4)
    matrix[:3, :3] = right, -down, -forward
    height, width = camera.size
    numbers: dict[str, Sequence[float] | np.ndarray] = {
        "TranslationVector": [*(origin - camera.position), 1],
        "RotationMatrix": matrix.ravel(),
        "FocalMm": [focal],
        "PixelSizeMm": [1, 1],
        "ViewportPx": [width, height],
        "CenterPx": [width / 2, height / 2],
        "LensDistortion": [0, 0],
        "CameraType": [0],
        "BinaryData": [0],
    }
    return {name: " ".join(f"{float(value):.12g}" for value in values) for name, values in numbers.items()}


def write_project(
    folder: Path, mesh: Mesh, origin: np.ndarray, images: Sequence[np.ndarray], poses: Sequence[Pose]
) -> None:
    """Write mesh, pictures and cameras as FOLDER/project.mlp; positions count from `origin` on, in metres."""
    _write_ply(folder / "mesh.ply", mesh, origin)
    project = ElementTree.Element("MeshLabProject")
    models = ElementTree.SubElement(project, "MeshGroup")
    model = ElementTree.SubElement(models, "MLMesh", label="mesh", filename="mesh.ply", visible="1")
    ElementTree.SubElement(model, "MLMatrix44").text = " ".join(str(int(n)) for n in np.eye(4).ravel())
    rasters = ElementTree.SubElement(project, "RasterGroup")
    for panorama, (image, pose) in enumerate(zip(images, poses, strict=True)):
        for number, camera in enumerate(raster_cameras(pose, image.shape[1])):
            name = f"{panorama}-{number}.png"
            cv2.imwrite(str(folder / name), cut_view(image, pose, camera.rays())[..., ::-1])
            raster = ElementTree.SubElement(rasters, "MLRaster", label=name)
            ElementTree.SubElement(raster, "VCGCamera", shot_attributes(camera, origin))
            ElementTree.SubElement(raster, "Plane", semantic="1", fileName=name)
    text = ElementTree.tostring(project, encoding="unicode")
    (folder / "project.mlp").write_text("<!DOCTYPE MeshLabDocument>\n" + text, encoding="utf-8")


def _write_ply(path: Path, mesh: Mesh, origin: np.ndarray) -> None:
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += f"element face {len(mesh.triangles)}\nproperty list uchar int vertex_indices\nend_header\n"
    faces = np.zeros(len(mesh.triangles), [("n", "u1"), ("corners", "<i4", 3)])
    faces["n"], faces["corners"] = 3, mesh.triangles
    path.write_bytes(head.encode() + (mesh.vertices - origin).astype("<f4").tobytes() + faces.tobytes())


def texture_by_meshlab(
    folder: Path,
    environments: Path,
    mesh: Mesh,
    images: Sequence[np.ndarray],
    poses: Sequence[Pose],
    texels: int,
) -> tuple[FaceTexture, dict[str, float]]:
    """Texture a mesh by MeshLab's filter, about `texels` in all; its seconds and memory. RuntimeError where it cannot run."""
    origin = np.round(mesh.vertices.mean(axis=0))
    divided = divide_triangles(mesh, MAX_EDGE_M)
    write_project(folder, divided, origin, images, poses)
    side = int(np.ceil(np.sqrt(texels) / 64) * 64)
    used = peers.run("meshlab", environments, folder, str(side))
    image = cv2.cvtColor(np.asarray(cv2.imread(str(folder / "texture.png")), np.uint8), cv2.COLOR_BGR2RGB)
    return FaceTexture(divided, np.load(folder / "uv.npy", allow_pickle=False), np.asarray(image)), used
