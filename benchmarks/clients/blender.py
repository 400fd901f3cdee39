"""Exports in Blender: what it holds of them, and its picture beside Streetloom's own from the same place."""

from __future__ import annotations

import json
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.clients.browser import PATIENCE_S
from benchmarks.programs import blender, cjio
from facade_core.export.models.textured_mesh import mesh_y_up_frame
from facade_core.export.pictures.camera import PerspectiveCamera
from facade_core.export.pictures.rendering import average_samples, cast_view
from facade_core.export.pictures.views import choose_cameras, view_names
from tasks.publish.published_run import PublishedBlock

# Of pixels, so many are edges: those with the steepest brightness.
EDGES = 0.1
SIZE = (270, 432)


def in_blender(steps: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """What Blender told of each step (see `in_blender.py`); it runs in a process of its own."""
    python = blender()
    with tempfile.TemporaryDirectory() as folder:
        asked, told = Path(folder) / "steps.json", Path(folder) / "told.json"
        asked.write_text(json.dumps(list(steps)))
        script = Path(__file__).with_name("in_blender.py")
        done = subprocess.run(
            [str(python), str(script), str(asked), str(told)], capture_output=True, text=True, timeout=PATIENCE_S
        )
        if done.returncode or not told.is_file():
            raise RuntimeError(f"Blender ended with {done.returncode}: {done.stderr[-2000:]}")
        return list(json.loads(told.read_text()))


def obj_by_cjio(city: Path) -> Path:
    """A CityJSON file as OBJ beside it, moved to where its coordinates begin: Blender's have 24 bits."""
    target = city.parent / f"{city.name.partition('.')[0]}.obj"
    command = [str(cjio()), "--suppress_msg", city.name, "crs_translate", "export", "obj", target.name]
    subprocess.run(command, cwd=city.parent, check=True, capture_output=True, timeout=PATIENCE_S)
    return target


def moved_by_cjio(city: Path) -> np.ndarray:
    """How far `obj_by_cjio` moves a file's coordinates towards zero, (3,) metres."""
    document = json.loads(city.read_text())
    scale, translate = (np.array(document["transform"][key]) for key in ("scale", "translate"))
    return np.array(document["vertices"]).min(axis=0) * scale + translate


def of_street(found: PublishedBlock) -> PerspectiveCamera:
    """The first of a block's views along a street, small; that from above where there is none."""
    views = dict(zip(view_names(found.plan), choose_cameras(found.plan, found.records), strict=True))
    return replace(views.get("street-0", views["above"]), size=SIZE)


def shot(camera: PerspectiveCamera, origin: np.ndarray, to: Path) -> dict[str, Any]:
    """What a step renders: a camera's picture of a file whose coordinates begin at an origin (3,) of the block's."""
    return {
        "to": str(to),
        "position": (camera.position - origin).tolist(),
        "target": (camera.target - origin).tolist(),
        "field_of_view": camera.field_of_view,
        "size": list(camera.size),
    }


def origin_of_models(found: PublishedBlock) -> np.ndarray:
    """Where the coordinates of a block's GLB begin, (3,)."""
    return mesh_y_up_frame(found.plan.scene.mesh).origin


def own_picture(found: PublishedBlock, camera: PerspectiveCamera) -> tuple[np.ndarray, np.ndarray]:
    """Streetloom's picture from a camera, (h, w, 3) uint8, without haze, which no export has, and where it shows a wall or
    roof, (h, w)."""
    samples = 2
    picture = cast_view(found.plan.scene, camera, samples=samples)
    for chart in picture.visible_charts.tolist():
        picture.paint({chart: found.textured_mesh.raster(chart)})
    built = np.zeros(picture.rgb.shape[:2], np.uint8).reshape(-1)
    built[picture.pixel[found.plan.scene.charts.building[picture.chart] >= 0]] = 255
    whole = average_samples(np.repeat(built.reshape(*picture.rgb.shape[:2], 1), 3, axis=2), samples)[..., 0] == 255
    return average_samples(picture.rgb, samples), whole


def compared(own: np.ndarray, theirs: Path, built: np.ndarray) -> dict[str, float]:
    """A client's picture (RGBA) beside Streetloom's own, (h, w, 3): the median difference of colours on what is built, of 255,
    the share of that which the client shows too, and the share of the steepest edges of each that lie within a pixel of the
    other's."""
    import cv2
    from PIL import Image

    picture = np.array(Image.open(theirs).convert("RGBA"))
    there = picture[..., 3] > 250
    both = built & there
    edges = []
    for rgb in (own, picture[..., :3]):
        grey = cv2.GaussianBlur(np.ascontiguousarray(rgb).mean(axis=2), (3, 3), 0)
        steep = np.hypot(cv2.Sobel(grey, cv2.CV_64F, 1, 0), cv2.Sobel(grey, cv2.CV_64F, 0, 1))
        inside = cv2.erode(both.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        edges.append(inside & (steep > np.quantile(steep[inside], 1 - EDGES)))
    near = [cv2.dilate(edge.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0 for edge in edges]
    shared = [(edges[0] & near[1]).sum() / edges[0].sum(), (edges[1] & near[0]).sum() / edges[1].sum()]
    difference = np.abs(own.astype(float) - picture[..., :3])[both].mean(axis=1)
    return {
        "colour_difference": round(float(np.median(difference)), 2),
        "shown": round(float(both.sum() / built.sum()), 4),
        "edges_shared": round(float(min(shared)), 3),
    }
