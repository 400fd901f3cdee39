"""The report's images: views of the block, panoramas, and every facade stage by stage."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TypeVar

import numpy as np

from catalogs.features import file_stem
from catalogs.published.made import Made
from catalogs.published.snapshot import Snapshot
from facade_core.atlas.journal import latest_digests, unit_key
from facade_core.export import Camera, aerial, aim, street_level
from facade_core.geometry.charts import CORNERS
from tasks.keys.stage_code import stage_code
from tasks.published.aside import Aside
from tasks.published.facade_stages import StoredFacade, stages_of
from tasks.published.pages import rasters_on
from tasks.published.stored import StoredBlock
from tasks.published.tiles import WrittenTile, coarse_of

VIEW_SIZE = (900, 1440)
# A facade from a photo is so much more worth showing than one from an exemplar.
PHOTO_WORTH = 4
# Views along streets, viewpoints of a street that are tried for its view, and panoramas.
STREETS, LOOKED_AT, PANORAMAS = 3, 24, 6
# Pages that are decoded for a view at most: one that shows more is so far away that coarse rasters do.
DECODED = 32
# Facades of a street that are shown stage by stage, beside those from photos; of the others the report has the texture alone.
STAGED = 16
TEXTURE = "result"

T = TypeVar("T")
# A file's name in report/images, and its title.
Titled = tuple[str, str]


@dataclass(frozen=True)
class Images:
    """What is in report/images: views along streets by their names, panoramas, the sheets of facades by their ids, and the
    facades of which only the texture is shown."""

    views: tuple[str, ...]
    panoramas: tuple[Titled, ...]
    sheets: Mapping[str, tuple[Titled, ...]]
    textures_only: frozenset[str]


def write_images(
    snapshot: Snapshot[Path], block: StoredBlock, tiles: Sequence[WrittenTile], made: Made, aside: Aside
) -> Images:
    """Write the folder of images, of pages and tiles that are written already; what cannot be drawn is set aside."""
    folder = (snapshot.report / "images").relative_to(snapshot.folder).as_posix()
    views = []
    for name, camera in cameras(block).items():
        with aside.trying(f"view {name}"):
            path = f"{folder}/{name}.jpg"
            made.put(path, _view_of(block, camera), partial(_view, snapshot, block, camera, tiles, aside))
            views.append(f"{name}.jpg")
            if aside.failed:  # something may be missing from it: it is not to be linked for a whole one
                del made.of[path]
    staged = _staged(block)
    sheets: dict[str, tuple[Titled, ...]] = {}
    for facade, id in enumerate(block.plan.facades.id):
        with aside.trying(f"pictures of facade {id}"):
            sheets[id] = tuple(_sheets(folder, block, facade, made, only=None if facade in staged else TEXTURE))
    return Images(
        tuple(name for name in views if name != "above.jpg"),
        tuple(_panoramas(folder, block, made, aside)),
        sheets,
        frozenset(id for facade, id in enumerate(block.plan.facades.id) if facade not in staged),
    )


def cameras(block: StoredBlock) -> dict[str, Camera]:
    """The block from above, and along some streets, from where most of the facades is seen, photos before others."""
    plan = block.plan
    worth = np.zeros(len(plan.scene.charts))
    for chart, record in zip(plan.facades.chart, block.records, strict=True):
        photo = record.get("provenance", [0.0])[-1] if record else 0.0
        worth[chart] = 1 + PHOTO_WORTH * photo
    found = {"above": aerial(plan.scene, VIEW_SIZE, worth)}
    streets = np.unique(plan.street_of_viewpoints).tolist()
    for number, street in enumerate(_spread(streets, STREETS)):
        own = _spread(plan.of_street(street), LOOKED_AT)
        found[f"street-{number}"] = street_level(plan.scene, own, VIEW_SIZE, worth)
    return found


def _view_of(block: StoredBlock, camera: Camera) -> str:
    """What a view is made of: whatever may be in sight, and its texels."""
    plan = block.plan
    charts = plan.scene.charts
    sight = np.flatnonzero(camera.may_show(charts.at_shares(np.arange(len(charts)), CORNERS)))
    digests = latest_digests(block.journals["surfaces"], [])
    things = plan.things.digest[np.unique(plan.things.of_chart[sight])]
    return unit_key(
        stage_code("publish"),
        [camera.position.tolist(), camera.target.tolist(), camera.field_of_view, camera.size],
        sorted((f"{number:016x}", digests.get(f"{number:016x}")) for number in plan.ids[sight].tolist()),
        sorted(things.tolist()),
    )


def _view(
    snapshot: Snapshot[Path], block: StoredBlock, camera: Camera, tiles: Sequence[WrittenTile], aside: Aside
) -> bytes:
    """A view as JPEG, painted from the pages that it shows, or from coarse rasters of tiles where these are very many."""
    picture = aim(block.plan.scene, camera)
    place = block.plan.scene.placement
    texels = np.column_stack([place.width, place.height])
    seen = picture.seen
    near = len(np.unique(place.page[seen])) <= DECODED
    parts: Iterable[Mapping[int, np.ndarray]]
    parts = rasters_on(snapshot, block, seen.tolist()) if near else coarse_of(block, tiles, aside)
    for rasters in parts:
        picture.paint(texels, rasters)
    return _jpeg(_halve(picture.rgb), 90)


def _staged(block: StoredBlock) -> set[int]:
    """The facades that are shown stage by stage: those from photos, and the first of each street."""
    count: Counter[int] = Counter()
    staged = set()
    for facade, (street, record) in enumerate(zip(block.plan.facades.street.tolist(), block.records, strict=True)):
        photo = record is not None and record.get("provenance", [0.0])[-1] > 0
        if photo or count[street] < STAGED:
            staged.add(facade)
            count[street] += not photo
    return staged


def _panoramas(folder: str, block: StoredBlock, made: Made, aside: Aside) -> Iterator[Titled]:
    """One JPEG for some of the viewpoints, titled by their units."""
    done = [(i, r) for i, r in enumerate(block.journals["viewpoints"]) if r and "panorama" in r]
    for number, record in _spread(done, PANORAMAS):
        name = f"panorama-{number}.jpg"
        with aside.trying(f"panorama {record['unit']}"):
            of = unit_key(stage_code("publish"), record["panorama"])
            made.put(f"{folder}/{name}", of, partial(_panorama, block, number))
            yield name, record["unit"]


def _sheets(folder: str, block: StoredBlock, facade: int, made: Made, only: str | None) -> Iterator[Titled]:
    """One WebP for each stage of a facade that the report shows, or for `only` one, in the order of the stages."""
    id, chart = block.plan.facades.id[facade], int(block.plan.facades.chart[facade])
    record = block.records[facade]
    if record is None:
        return
    stored = StoredFacade(block.group, block.plan.scene.placement, facade, chart, record, exemplars=())
    for stage in stages_of(stored):
        if stage.report is None or only not in (None, stage.report.name):
            continue
        name = f"{file_stem(id)}-{stage.report.name}.webp"
        of = unit_key(stage_code("publish"), stage.report.name, record["key"], record.get("digests"))
        made.put(f"{folder}/{name}", of, partial(_webp, stage.draw))
        yield name, stage.report.title


def _spread(values: list[T], count: int) -> list[T]:
    """At most `count` of the values, evenly spread."""
    if len(values) <= count:
        return values
    return [values[round(i * (len(values) - 1) / (count - 1))] for i in range(count)]


def _halve(rgb: np.ndarray) -> np.ndarray:
    import cv2

    return cv2.resize(rgb, (rgb.shape[1] // 2, rgb.shape[0] // 2), interpolation=cv2.INTER_AREA)


def _panorama(block: StoredBlock, viewpoint: int) -> bytes:
    return _jpeg(block.group["panoramas/rgb"][viewpoint], 88)


def _webp(draw: Callable[[], np.ndarray]) -> bytes:
    return _encoded(draw(), "WEBP", quality=82, method=2)


def _jpeg(rgb: np.ndarray, quality: int) -> bytes:
    return _encoded(rgb, "JPEG", quality=quality)


def _encoded(rgb: np.ndarray, format: str, **options: int) -> bytes:
    """A picture (h, w, 3) uint8 as a file."""
    from PIL import Image

    buffer = BytesIO()
    Image.fromarray(rgb).save(buffer, format, **options)
    return buffer.getvalue()
