"""Walls from pictures: `python -m benchmarks.photo_walls [--data DIR]` prints one JSON object.

painted: views of walls on painted streets. A facade of a house that the model lacks is pasted in front of some of them:
turned by 10 to 60 degrees (`turned`), or parallel to the wall and 2 to 5 m before it (`parallel`); `right`, views of at most a
tenth of it. Poses are off by 0.1 m and 0.3 degrees. views, and those that are rejected: by each picture alone (`alone`), and
with the other pictures of the wall (`together`). Views that it hides by a tenth to seven tenths are not counted.

amsterdam: with --data, both example blocks are run, with two exemplars; of the walls that a panorama shows: their area, the
share that wears a picture of another building, by eye (`wrong_share`, WRONG_VIEWS), and that is inpainted; flags of the
catalogue, and each wall. --sheet FILE keeps a contact sheet of the walls, --out FOLDER the runs; those there are taken.
"""

from __future__ import annotations

import argparse
import json
import os
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import yaml

from benchmarks.city.runs import run
from benchmarks.look.outputs import Facade, Output, facade_items, read_output
from benchmarks.painter.exemplars import paint_exemplar_set
from benchmarks.painter.street_truth import SyntheticStreet, cutout_mask, render_street_panorama, synthetic_street
from catalogs.examples.sources import EXAMPLE_BLOCKS_FOLDER
from facade_core.core.types import Pose
from facade_core.geometry.equirectangular import panorama_rays
from facade_core.imagery.panorama_camera import camera_from_world, camera_position
from facade_core.imagery.rectify.panorama import find_sightings, rectify_chart_from_panorama
from facade_core.imagery.rectify.pictured_plane import camera_in_chart_frame, explain_other_planes

BUILDINGS, CAMERAS, WIDTH = 8, 4, 3072
# Of a pasted facade's picture, and of the rectified walls.
PASTED_PER_METRE, WALL_PER_METRE = 25.0, 12.0
POSE_NOISE_M, POSE_NOISE_DEG = 0.1, 0.3
# A view shows another building from this share on, and its wall up to this.
WRONG, RIGHT, LEAST_SEEN = 0.7, 0.1, 0.2
VIEWS = 3
# Walls of the example blocks that a panorama shows.
PICTURED = (
    *(f"paleis-{n}" for n in (1, 3, 5)),
    *(f"tussauds-{n}" for n in (3, 4)),
    *(f"0363100012143961-{n}" for n in (1, 2, 3, 4)),
    *(f"pand_0363100012066079-{n}" for n in range(6)),
    *(f"pand_0363100012115783-{n}" for n in (0, 2, 3, 4)),
)
# Panoramas that show another building on a wall of the example blocks, by eye: the model lacks what stands before it.
WRONG_VIEWS = {
    "0363100012143961-2": ("TMX7316010203-000724_pano_0000_001219.jpg",),
    "pand_0363100012066079-4": ("TMX7316010203-000724_pano_0000_001219.jpg",),
    "pand_0363100012115783-2": ("TMX7316010203-000724_pano_0000_001219.jpg",),
}
EXEMPLARS = 2
SHEET_HEIGHT, SHEET_WIDTH = 300, 2000


class Pasted(NamedTuple):
    """A facade that the model lacks: how it stands, its upper left corner, direction, size in metres, and picture."""

    kind: str
    corner: np.ndarray
    along: np.ndarray
    size: tuple[float, float]
    picture: np.ndarray


def count_painted_views(streets: int) -> dict[str, Any]:
    """Count the rejected views of painted walls, by what they show."""
    counts: dict[str, Counter[str]] = {kind: Counter() for kind in ("right", "turned", "parallel")}
    for seed in range(3, 3 + streets):
        _count_street(seed, counts)
    return {kind: dict(count) for kind, count in counts.items()}


def _count_street(seed: int, counts: dict[str, Counter[str]]) -> None:
    street, rng = synthetic_street(BUILDINGS, seed=seed), np.random.default_rng(seed)
    pasted = _paste_facades(street, seed, rng)
    true, given, images, covered = [], [], [], []
    for number in range(CAMERAS):
        x, y = street.world_point((number + 0.5) / CAMERAS * street.length, (-1) ** number * 1.5)
        pose = Pose(float(x), float(y), 2.5, float(rng.uniform(0, 360)), *rng.normal(0, 0.5, 2).tolist())
        image = render_street_panorama(street, pose, WIDTH, gain=float(rng.uniform(0.7, 1.0)), seed=number)
        before = np.full(image.shape[:2], -1)
        for which, one in pasted.items():
            _draw(image, before, pose, which, one)
        off = rng.normal(0, 1, 5) * ([POSE_NOISE_M] * 2 + [POSE_NOISE_DEG] + [POSE_NOISE_DEG / 3] * 2)
        near = replace(pose, x=pose.x + off[0], y=pose.y + off[1], heading=pose.heading + off[2])
        given.append(replace(near, pitch=pose.pitch + off[3], roll=pose.roll + off[4]))
        true.append(pose)
        images.append(image)
        covered.append(before)
    for facade, chart in enumerate(street.charts):
        wide, high = street.scene.charts.size[chart].tolist()
        size = (max(16, round(high * WALL_PER_METRE)), max(16, round(wide * WALL_PER_METRE)))
        density = size[0] / high
        views, cameras, shown = [], [], []
        for sighting in find_sightings(street.scene, chart, given, [image.shape[:2] for image in images])[:VIEWS]:
            k = sighting.panorama
            view = rectify_chart_from_panorama(street.scene, chart, images[k], given[k], size, covered[k] >= 0)
            if view.seen.mean() < LEAST_SEEN:
                continue
            hidden = np.zeros(size, bool) if view.occluded is None else view.occluded
            other = float(hidden.sum() / view.seen.sum())
            kinds = [pasted[which].kind for which in np.unique(covered[k][covered[k] >= 0]).tolist()]
            cut = cutout_mask(street, facade, true[k], size, assumed_pose=given[k]) & ~hidden
            views.append(replace(view, occluded=cut & view.seen))
            cameras.append(camera_in_chart_frame(street.scene, chart, given[k]))
            own = pasted[facade].kind if facade in pasted else "turned" if "turned" in kinds else "parallel"
            shown.append("right" if other <= RIGHT else own if other >= WRONG else "partly")
        alone = [explain_other_planes([v], [c], density)[0] for v, c in zip(views, cameras, strict=True)]
        together = explain_other_planes(views, cameras, density)
        for kind, by_itself, with_others in zip(shown, alone, together, strict=True):
            if kind != "partly":
                counts[kind].update(views=1, alone=int(bool(by_itself)), together=int(bool(with_others)))


def _paste_facades(street: SyntheticStreet, seed: int, rng: np.random.Generator) -> dict[int, Pasted]:
    """Place facades before every second wall."""
    charts, found = street.scene.charts, {}
    pictures = paint_exemplar_set(BUILDINGS, seed=seed + 100, metres_per_pixel=1 / PASTED_PER_METRE)
    for facade in range(1, BUILDINGS, 2):
        chart, kind = street.charts[facade], ("turned", "parallel")[facade // 2 % 2]
        turn = np.radians(rng.choice([-1, 1]) * rng.uniform(10, 60)) if kind == "turned" else 0.0
        wide, high = 1.3 * float(charts.size[chart][0]), float(charts.size[chart][1]) + 3.0
        u, v, _ = charts.axis_u[chart]
        along = np.array([u * np.cos(turn) - v * np.sin(turn), u * np.sin(turn) + v * np.cos(turn), 0.0])
        middle = charts.origin[chart] + charts.axis_u[chart] * charts.size[chart][0] / 2
        corner = middle + charts.normals()[chart] * rng.uniform(2, 5) - along * wide / 2
        corner[2] = high
        found[facade] = Pasted(kind, corner, along, (wide, high), pictures[facade].image)
    return found


def _draw(image: np.ndarray, before: np.ndarray, pose: Pose, which: int, pasted: Pasted) -> None:
    """Draw a facade into a panorama, and its number where it is drawn, in place."""
    height, width = before.shape
    rays = panorama_rays(np.array([0.0, 1.0]), width).reshape(height, width, 3)
    turned = replace(pose, heading=0.0, pitch=0.0, roll=0.0)
    rays = rays @ camera_from_world(turned).T @ camera_from_world(pose)
    normal = np.cross(pasted.along, [0.0, 0.0, -1.0])
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = ((pasted.corner - camera_position(pose)) @ normal) / (rays @ normal)
        offset = camera_position(pose) + reach[..., None] * rays - pasted.corner
    x, y = offset @ pasted.along, -offset[..., 2]
    on = (reach > 0) & (x >= 0) & (x <= pasted.size[0]) & (y >= 0) & (y <= pasted.size[1])
    column, row = ((PASTED_PER_METRE * np.where(on, at, 0)).astype(np.float32) for at in (x, y))
    colour = cv2.remap(pasted.picture, column, row, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REFLECT)
    image[on], before[on] = colour[on], which


def amsterdam(data: Path, out: Path, sheet: Path | None) -> dict[str, Any]:
    """Run both example blocks and measure their walls with pictures."""
    tiles: list[tuple[str, np.ndarray]] = []
    rows: list[dict[str, Any]] = []
    for name in ("amsterdam-dam", "amsterdam-ij"):
        if not (out / f"{name}-run").exists():
            run(_write_block(name, data.resolve(), out / name), out / f"{name}-run", 1)
        output = read_output(out / f"{name}-run")
        for facade, row in facade_items(output):
            if facade.id in PICTURED:
                rows.append(_measure(output, facade, row))
                tiles.append((f"{len(tiles) + 1}", _picture(output, facade)))
    if sheet is not None:
        cv2.imwrite(str(sheet), contact_sheet(tiles)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 80])
    area = sum(row["m2"] for row in rows)
    return {
        "walls": len(rows),
        "m2": round(area),
        "wrong_share": round(sum(row["m2"] for row in rows if row["wrong"]) / area, 4),
        "inpainted_share": round(sum(row["m2"] * row["inpainted"] for row in rows) / area, 4),
        "flags": dict(Counter(flag for row in rows for flag in row["quality"].split(", "))),
        "by_wall": rows,
    }


def _write_block(name: str, data: Path, folder: Path) -> Path:
    """Write an example block with its paths resolved and few exemplars."""
    exemplars = folder / "exemplars"
    exemplars.mkdir(parents=True, exist_ok=True)
    pictures = sorted((data / "facades" / "ecp" / "images").glob("*.jpg"))
    for path in pictures[:: max(1, len(pictures) // EXEMPLARS)][:EXEMPLARS]:
        (exemplars / path.name).write_bytes(path.read_bytes())
    os.environ["STREETLOOM_DATA"] = str(data)
    stated = yaml.safe_load(os.path.expandvars((EXAMPLE_BLOCKS_FOLDER / f"{name}.yaml").read_text(encoding="utf-8")))
    stated["imagery"]["exemplars"] = {"path": str(exemplars.resolve())}
    file = folder / "block.yaml"
    file.write_text(yaml.safe_dump(stated), encoding="utf-8")
    return file


def _measure(output: Output, facade: Facade, row: Any) -> dict[str, Any]:
    used = str(row.source).split(", ")
    number = [str(name) for name in output.group["facades/id"][:]].index(facade.id)
    record = json.loads(str(output.group["journal/facades"][number]))
    return {
        "id": facade.id,
        "m2": round(float(output.charts.size[facade.chart].prod()), 1),
        "source": row.source,
        "wrong": (row.photo or 0) > 0 and any(picture in WRONG_VIEWS.get(facade.id, ()) for picture in used),
        "photo": round(float(row.photo or 0), 3),
        "inpainted": round(float(row.inpainted or 0), 3),
        "quality": str(row.quality),
        "reason": row.reason if isinstance(row.reason, str) else None,
        "pictured_colour": record.get("pictured_colour"),
        "tone_slope": record.get("tone_slope"),
        "repeated_foot": record.get("repeated_foot"),
    }


def _picture(output: Output, facade: Facade) -> np.ndarray:
    return output.raster(output.pixels(int(output.placement.page[facade.chart])), facade.chart)


def contact_sheet(tiles: Sequence[tuple[str, np.ndarray]]) -> np.ndarray:
    """Lay pictures (h, w, 3) of one height in rows, each below its name."""
    rows: list[list[np.ndarray]] = [[]]
    for name, picture in tiles:
        wide = min(SHEET_WIDTH, max(40, round(picture.shape[1] * SHEET_HEIGHT / picture.shape[0])))
        tile = cv2.resize(picture, (wide, SHEET_HEIGHT), interpolation=cv2.INTER_AREA)
        tile = cv2.copyMakeBorder(tile, 24, 4, 2, 2, cv2.BORDER_CONSTANT, value=(255, 255, 255))
        cv2.putText(tile, name, (3, 18), cv2.FONT_HERSHEY_SIMPLEX, 0.55, (0, 0, 0), 1, cv2.LINE_AA)
        if sum(one.shape[1] for one in rows[-1]) + tile.shape[1] > SHEET_WIDTH and rows[-1]:
            rows.append([])
        rows[-1].append(tile)
    joined = [np.concatenate(row, axis=1) for row in rows if row]
    wide = max(row.shape[1] for row in joined)
    return np.concatenate([np.pad(r, ((0, 0), (0, wide - r.shape[1]), (0, 0)), constant_values=255) for r in joined])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--data", type=Path, help="folder with city/amsterdam and facades/ecp")
    parser.add_argument("--streets", type=int, default=4)
    parser.add_argument("--out", type=Path, help="folder in which the runs are kept; none without")
    parser.add_argument("--sheet", type=Path, help="contact sheet of the walls, a JPEG")
    options = parser.parse_args()
    result: dict[str, Any] = {"benchmark": "photo_walls"}
    if options.streets:
        result["painted"] = count_painted_views(options.streets)
    if options.data:
        with tempfile.TemporaryDirectory(prefix="photo-walls-") as folder:
            result["amsterdam"] = amsterdam(options.data, options.out or Path(folder), options.sheet)
    print(json.dumps(result, indent=1))


if __name__ == "__main__":
    main()
