"""A block as users have it: models with textures of their own, no streets, posed panoramas, and a broken unit of every kind."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import geopandas as gpd
import numpy as np
import pytest
import trimesh
import yaml
import zarr
from PIL import Image

from benchmarks.painter.exemplars import paint_exemplar_set
from facade_core.atlas.store import open_repository
from facade_core.core.provenance import Provenance
from tests.pipeline.runs import run

pytestmark = pytest.mark.long

X, Y, GROUND = 121_000.0, 487_000.0, 1.5


def house(
    city: dict[str, Any],
    id: str,
    x: float,
    y: float,
    textured: bool = False,
    size: tuple[float, float, float] = (12, 10, 9),
) -> None:
    """A box in the city; its northern wall and its roof may carry the texture."""
    first = len(city["vertices"])
    wide, deep, high = size
    for z in (GROUND, GROUND + high):
        city["vertices"] += [[X + x + u, Y + y + v, z] for u, v in ((0, 0), (wide, 0), (wide, deep), (0, deep))]
    faces = [[i, (i + 1) % 4, (i + 1) % 4 + 4, i + 4] for i in range(4)] + [[3, 2, 1, 0], [4, 5, 6, 7]]
    geometry: dict[str, Any] = {
        "type": "MultiSurface",
        "lod": "2",
        "boundaries": [[[first + corner for corner in face]] for face in faces],
        "semantics": {
            "surfaces": [{"type": "WallSurface"}, {"type": "GroundSurface"}, {"type": "RoofSurface"}],
            "values": [0, 0, 0, 0, 1, 2],
        },
    }
    if textured:
        geometry["texture"] = {
            "photo": {"values": [[[None]]] * 2 + [[[0, 0, 1, 2, 3]]] + [[[None]]] * 2 + [[[0, 0, 1, 2, 3]]]}
        }
    city["CityObjects"][id] = {"type": "Building", "geometry": [geometry], "attributes": {"storeysAboveGround": 3}}


def write_inputs(folder: Path) -> Path:
    city: dict[str, Any] = {
        "type": "CityJSON",
        "version": "2.0",
        "transform": {"scale": [1, 1, 1], "translate": [0, 0, 0]},
        "metadata": {"referenceSystem": "https://www.opengis.net/def/crs/EPSG/0/28992"},
        "appearance": {
            "textures": [{"type": "PNG", "image": "wall.png"}],
            "vertices-texture": [[0, 0], [1, 0], [1, 1], [0, 1]],
        },
        "CityObjects": {"empty": {"type": "Building"}},
        "vertices": [],
    }
    for row, y in enumerate((0, 24)):
        for column in range(2):
            id = "plot 12/4" if row == column == 1 else f"h{row}{column}"
            house(city, id, 16.0 * column, y, textured=row == column == 1)
    house(city, "behind", 40, 40)  # shown by no picture
    house(city, "shed", -6, 12, size=(3, 10, 2.45))  # too low for facades
    house(city, "nowhere", 60, 0)
    city["vertices"][-1][0] = float("nan")
    (folder / "city.json").write_text(json.dumps(city))
    painted = list(paint_exemplar_set(3, seed=1, metres_per_pixel=1 / 8))
    Image.fromarray(painted[0].image).save(folder / "wall.png")
    (folder / "facades").mkdir()
    for number, exemplar in enumerate(painted):
        Image.fromarray(exemplar.image).save(folder / "facades" / f"{number}.png")
    (folder / "panoramas").mkdir()
    rows, columns = np.mgrid[0:512, 0:1024]
    around = 2 * np.pi * columns / 1024
    wave = 128 + 60 * np.sin(18 * around) * np.cos(rows / 7) * np.sin(np.pi * (rows + 0.5) / 512)
    pictures = {
        "seen": wave,
        "unposed": wave + 1,
        "cut": wave,
        "photo": 128 + 60 * np.cos(rows / 7) * np.sin(around / 4),
    }
    for name, grey in pictures.items():
        shade = grey.astype(np.uint8)
        Image.fromarray(np.dstack([shade, shade, 255 - shade])).save(folder / "panoramas" / f"{name}.jpg")
    (folder / "panoramas" / "twice.jpg").write_bytes((folder / "panoramas" / "seen.jpg").read_bytes())
    cut = folder / "panoramas" / "cut.jpg"
    cut.write_bytes(cut.read_bytes()[:2000])
    pose = {"x": X + 6, "y": Y + 17, "z": GROUND + 2.5, "heading": 0}
    (folder / "poses.json").write_text(
        json.dumps({"crs": "EPSG:28992", "poses": dict.fromkeys(("seen", "cut", "photo", "twice"), pose)})
    )
    block = {
        "name": "four-houses",
        "buildings": {"path": "city.json"},
        "imagery": {"exemplars": {"path": "facades"}, "panoramas": {"path": "panoramas", "poses": "poses.json"}},
        "texture": {"texels_per_metre": 4, "panorama_width": 256},
    }
    (folder / "block.yaml").write_text(yaml.safe_dump(block))
    return folder / "block.yaml"


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, dict[str, Any]]:
    folder = tmp_path_factory.mktemp("inputs")
    block = write_inputs(folder)
    return block, folder / "out", run(block, folder / "out", workers=2, expect=1)


def test_everything_else_is_published_and_the_reasons_are_in_the_catalogue(done: Any) -> None:
    _, _, summary = done
    assert summary["facades_failed"] == 0
    assert summary["facades_done"] >= 12
    assert summary["viewpoints"] > 4, "streets are derived"
    items = gpd.read_parquet(summary["outputs"]["items"])
    aside = items[items.kind != "facade"]
    assert sorted(zip(aside.kind, aside.id, strict=True)) == [
        ("building", "empty"),
        ("building", "nowhere"),
        ("panorama", "cut.jpg"),
        ("panorama", "photo.jpg"),
        ("panorama", "twice.jpg"),
        ("panorama", "unposed.jpg"),
    ]
    assert aside.reason.str.len().min() > 10
    said = aside.set_index("id").reason
    assert said["photo.jpg"].startswith("is cut off, or no panorama: its left and right sides do not meet")
    assert said["twice.jpg"] == "is the same picture as seen.jpg; remove one, or mend its file"
    assert {one["unit"] for one in (*summary["failures"], *summary["refused"])} == set(aside.id)
    assert "four-houses" in Path(summary["outputs"]["report"]).read_text()
    report = Path(summary["outputs"]["report"])
    assert "nowhere" in report.read_text()
    pages = "".join(page.read_text() for page in report.parent.rglob("*.html"))
    pictures = re.findall(r'src="(?:\.\./)*(images/[^"]+)"', pages)
    assert any("plot_12_4-0" in picture for picture in pictures), "an id with a slash is no folder"
    assert all((report.parent / unquote(picture)).is_file() for picture in pictures)


def test_own_textures_and_panoramas_are_photos_and_the_rest_is_synthesised(done: Any) -> None:
    _, out, summary = done
    items = gpd.read_parquet(summary["outputs"]["items"]).set_index("id")
    sources = items.source.dropna()
    assert "own texture" in set(sources)
    assert any(source == "seen.jpg" for source in sources)
    assert any(source in ("0", "1", "2") for source in sources)
    own = items[(items.source == "own texture") & (items.synthesised < 1)]  # another wall of its house takes its style
    assert len(own)
    assert (own.photo > 0.95).all()
    # The picture is a wave of two colours: what the parser takes for something in front of it is no matter here.
    assert (items[(items.source == "seen.jpg") & (items.synthesised < 1)].photo > 0).all()
    session = open_repository(out / "store").readonly_session("main")
    group = zarr.open_group(session.store, mode="r")
    left = {
        record["unit"]: record.get("residual_deg") for record in map(json.loads, group["journal/poses"][:].tolist())
    }
    told = items[items.source == "seen.jpg"].pose_residual_deg
    assert told.isna().all() if left["seen.jpg"] is None else (told == left["seen.jpg"]).all()
    assert items[items.source != "seen.jpg"].pose_residual_deg.isna().all()
    assert items[items.source == "seen.jpg"].pose_raised_m.notna().all()
    assert items.pose_apart_m.isna().all(), "it is the only one"
    charts = group["charts"]
    roof = np.flatnonzero(charts["textured"][:] & (charts["kind"][:] == 1))
    assert len(roof) == 1, "one roof has a texture of its own"
    page, y, x = (int(charts[name][roof[0]]) for name in ("page", "y", "x"))
    height, width = int(charts["height"][roof[0]]), int(charts["width"][roof[0]])
    assert (group["atlas/provenance"][page, y : y + height, x : x + width] == Provenance.PHOTO).mean() > 0.98


def test_a_wall_that_is_no_facade_is_taken_from_the_panorama(done: Any) -> None:
    """The shed's wall that the camera faces; how much of it is masked is no matter here."""
    _, out, _ = done
    session = open_repository(out / "store").readonly_session("main")
    group = zarr.open_group(session.store, mode="r")
    (record,) = [json.loads(text) for text in group["journal/walls"][:].tolist()]
    assert (record["unit"], record["status"]) == ("shed", "done")
    ((name, share, metres),) = record["cameras"]
    assert name == "seen.jpg"
    assert 0 < share < 1
    assert 8 < metres < 11
    charts = group["charts"]
    (wall,) = [c for c, number in enumerate(charts["id"][:].tolist()) if f"{number:016x}" in record["digests"]]
    page, y, x = (int(charts[name][wall]) for name in ("page", "y", "x"))
    here = (page, slice(y, y + int(charts["height"][wall])), slice(x, x + int(charts["width"][wall])))
    pictured = group["atlas/provenance"][here] == Provenance.PHOTO
    np.testing.assert_array_equal(group["facade_maps/camera"][here], pictured)
    assert pictured.any()


def test_the_model_stands_at_its_height_on_the_ground(done: Any) -> None:
    _, _, summary = done
    scene = trimesh.load(summary["outputs"]["glb"][0])
    low, high = scene.bounds[:, 1]
    assert high - low == pytest.approx(9.0, abs=0.2)
    origin = scene.metadata["origin"]
    assert origin[2] + high == pytest.approx(GROUND + 9, abs=0.2)


def test_a_rerun_does_nothing_and_still_says_what_was_set_aside(done: Any) -> None:
    block, out, first = done
    again = run(block, out, expect=1)
    assert again["units_done"] == 0
    assert again["atlas_digest"] == first["atlas_digest"]
    assert (again["failures"], again["refused"]) == (first["failures"], first["refused"])
