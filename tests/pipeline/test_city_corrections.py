"""What people corrected of a city: beside its own file, done again in the blocks that it touches, kept however it is cut."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import yaml

from catalogs.block.corrections import corrections_file, read_corrections
from catalogs.block.reader import read_block
from catalogs.query.execution import query
from facade_core.core.errors import InputError
from tasks.city.blocks import partition_city_file
from tasks.city.city_log import load_or_partition_city
from tasks.corrections.correction_import import CorrectionImporter, import_corrections
from tasks.engine.store.status import record_run_block_file
from tasks.export.formats import export_run
from tasks.publish.task import publish_block
from tests.pipeline.stages import texture, write_block

# Houses along one street, farther apart than context reaches, and one beside the second; a block each, the last two in one.
HOUSES = {"h0": (4, 5, 12, 2.8, 7.0), "h1": (304, 5, 12, 2.8, 7.0), "h2": (324, 5, 12, 2.8, 9.0)}
STREETS = {"1": [(0, 0), (300, 0), (345, 0)]}


def town(folder: Path, metres: int = 300, houses: dict[str, tuple[float, ...]] = HOUSES) -> Path:
    block = write_block(folder, buildings=houses, streets=STREETS)
    keys = yaml.safe_load(block.read_text()) | {"name": "town", "cut": {"metres": metres}}
    (folder / "town.yaml").write_text(yaml.safe_dump(keys))
    return folder / "town.yaml"


def made(city: Path, *names: str) -> dict[str, Path]:
    """The blocks of a city, textured and published: all, or some; their files by name."""
    out = city.parent / "out"
    files = load_or_partition_city(city, out)[1]
    for name in names or files:
        done = texture(files[name], out / "blocks" / name)
        record_run_block_file(out / "blocks" / name, files[name])
        publish_block.fn(done.run, files[name])
    return files


def said(folder: Path, *corrections: dict[str, Any]) -> Path:
    (folder / "said.json").write_text(json.dumps({"corrections": corrections}))
    return folder / "said.json"


@pytest.mark.long
def test_a_city_is_corrected_by_one_file_and_redone_where_that_touches_it(tmp_path: Path) -> None:
    city, out = town(tmp_path), tmp_path / "out"
    files = made(city)
    before = load_or_partition_city(city, out)[0].digests
    assert len(before) == 2
    of = {b: name for name in files for b in read_block(files[name]).part.buildings}  # type: ignore[union-attr]
    store = tmp_path / "town.corrections.jsonl"
    done = import_corrections(
        out,
        said(
            tmp_path,
            {"building_id": "h1", "height": 9.5, "wall_material": "brick"},
            {"facade_id": "h2-0", "elements": [["door", 0.4, 0.7, 0.5, 1.0]]},
        ),
        who="anna",
    )
    assert (done.files, done.facades, done.buildings) == ((store,), 1, 1)
    assert done.command == f"streetloom city {city} --out {out}"
    after = load_or_partition_city(city, out)[0].digests
    assert [name for name in before if before[name] != after[name]] == [of["h1"]] == [of["h2"]]
    made(city, of["h1"])
    assert set(query(out, where="corrected = 1")["building"]) == {"h1", "h2"}
    assert set(query(out, where="building = 'h1'")["height_m"]) == {9.5}
    assert read_block(files[of["h1"]]).digest == after[of["h1"]], "its run reads what the city was cut with"
    for name in files:
        given = export_run(out / "blocks" / name, "cityjson", tmp_path / f"exported-{name}").path
        assert not import_corrections(out, next(given.glob("*.city.json")), who="ben").files
    whole = export_run(out, "gpkg", tmp_path / "whole.gpkg").path
    assert not import_corrections(out, whole, who="ben").files

    # of a block by itself, as the viewer does, it goes to the same file
    CorrectionImporter(out / "blocks" / of["h0"]).add([{"building_id": "h0", "levels": 2}], "said", who="ben")
    assert {"h0", "h1", "h2-0"} == set(read_corrections(city).by_target)
    assert corrections_file(files[of["h0"]]) == store
    with pytest.raises(InputError, match=r"no block of the city in .* has h9"):
        import_corrections(out, said(tmp_path, {"building_id": "h9", "levels": 2}), who="anna")
    picture = {"imageWidth": 9, "imageHeight": 9, "imagePath": "h0-0.png", "shapes": []}
    for id in (5, ["h0-0"], float("nan")):
        (tmp_path / "shown.json").write_text(json.dumps(picture | {"facade": id}))
        with pytest.raises(InputError, match=r"shown\.json: .* is no id of a facade or building; write it as"):
            import_corrections(out, tmp_path / "shown.json", who="anna")

    # cut otherwise, with another id for a house and one house less: nothing is lost
    renamed = {"h0": HOUSES["h0"], "x": HOUSES["h1"]}
    cut = partition_city_file(town(tmp_path, 5000, renamed), out)
    (block,) = [read_block(one.file) for one in cut.blocks]
    assert {building.id: building.height for building in block.buildings} == {"h0": 7.0, "x": 9.5}
    assert {building.id: building.finish.wall_material for building in block.buildings} == {"h0": None, "x": "brick"}
    assert set(block.corrections.by_target) == {"h0", "x"}
    assert [one for one in cut.set_aside if one[0] == "correction"] == [
        ("correction", "h2-0", "corrected, and not in the city as it is: kept and not used")
    ]
    assert {"h0", "h1", "h2-0"} == set(read_corrections(city).by_target)
