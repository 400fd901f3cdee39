"""Files beside those of a block file: pipes, devices, odd documents, parts of a city. One line, at once, bounded."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from catalogs.block.corrections import read_corrections
from catalogs.block.extract import EXTRACT_FORMAT, read_city_part
from catalogs.block.reader import read_block
from catalogs.city.tile_index import tile_files_in_area
from catalogs.imagery.fetch_log import FETCH_LOG_NAME, read_fetch_log
from catalogs.readers.annotations import read_correction_annotations
from catalogs.readers.json_text import load_json
from catalogs.readers.pictures.poses import read_poses_file
from facade_core.core.errors import BlockFileError, InputError
from facade_core.core.regular_files import open_regular, read_regular
from tasks.city.blocks import partition_city_file
from tasks.matching.match_table import read_match_table
from training.datasets.layouts import read_layouts

DEEP = b"[" * 100_000
READERS: dict[str, Callable[[Path], object]] = {
    "x.json": load_json,
    "y.json": lambda path: read_correction_annotations(path, {}),
    "x.jsonl": lambda path: read_correction_annotations(path, {}),
    "x.gpkg": lambda path: read_correction_annotations(path, {}),
    "x.csv": read_match_table,
    "poses.json": read_poses_file,
    "layouts.jsonl": lambda path: list(read_layouts(path)),
    "b.corrections.jsonl": lambda path: read_corrections(path.with_name("b.yaml")),
    "part.npz": read_city_part,
    "tiles.json": lambda path: tile_files_in_area(path, None),
}


def part_file(path: Path, values: object, blob: bytes = b"\0") -> Path:
    text = json.dumps({"format": EXTRACT_FORMAT, "values": values}).encode()
    np.savez_compressed(path, text=np.frombuffer(text, np.uint8), blob=np.frombuffer(blob, np.uint8))
    return path


@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
@pytest.mark.parametrize("name", READERS)
def test_what_is_no_regular_file_is_refused_at_once(name: str, kind: str, tmp_path: Path) -> None:
    path = tmp_path / name
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    else:
        path.mkdir()
    with pytest.raises(InputError) as raised:
        READERS[name](path)
    assert "\n" not in str(raised.value)
    assert name in str(raised.value) or kind == "folder"


@pytest.mark.parametrize("name", READERS)
def test_a_document_nested_100_000_deep_is_refused_in_one_line(name: str, tmp_path: Path) -> None:
    (tmp_path / name).write_bytes(DEEP)
    with pytest.raises(InputError) as raised:
        READERS[name](tmp_path / name)
    assert "\n" not in str(raised.value)


def test_a_log_of_fetched_pictures_nested_deep_is_refused(tmp_path: Path) -> None:
    (tmp_path / FETCH_LOG_NAME).write_bytes(DEEP + b"\n")
    with pytest.raises(InputError, match="line 1"):
        read_fetch_log(tmp_path)


def test_a_file_is_read_up_to_its_bound(tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"1234")
    assert read_regular(tmp_path / "a", 4) == b"1234"
    with pytest.raises(InputError, match="more than 3 bytes"):
        read_regular(tmp_path / "a", 3)
    with pytest.raises(FileNotFoundError):
        open_regular(tmp_path / "b")
    for path in ("/proc/kmsg", "/proc/self/status", "/dev/zero"):  # the first two look regular, and the first may block
        with pytest.raises(InputError, match="a device or a file of the system; name a file"):
            open_regular(Path(path))


BUILDING = {"Building": ["a", 5, 7.0, "height"]}
GOOD = {
    "crs": "EPSG:32635",
    "extent": [0, 0, 1, 1],
    "buildings": [],
    "streets": [],
    "entrances": [],
    "ground": {"MappedGround": [[], [], None, []]},
    "exemplars": [],
    "photos": {"map": []},
    "panoramas": [],
    "textures": [],
    "aerial": None,
    "faults": [],
    "geoid_separation": None,
    "part": {"CityPart": [[], [], [], [], []]},
}
PARTS: dict[str, object] = {
    "list": [1],
    "int": 5,
    "empty": {"map": []},
    "nothing": {"map": [*GOOD.items()][:5]},
    "two-kinds": {"map": [["crs", {"a": 1, "b": 2}]]},
    "unknown-class": {"map": [["crs", {"Popen": ["ls"]}]]},
    "array-twice": {"map": [["a", {"array": ["|u1", [1], 0]}], ["b", {"array": ["|u1", [1], 0]}]]},
    "array-huge": {"map": [["a", {"array": ["|u1", [10**12], 0]}]]},
    "array-negative": {"map": [["a", {"array": ["|u1", [-1], 0]}]]},
    "array-without-size": {"map": [["a", {"array": ["V0", [10**12], 0]}]]},
    "array-of-lists": {"map": [["a", {"array": [[], {}, ""]}]]},
    "shape-negative": {"map": [["a", {"shape": [-5, 2]}]]},
    "path-of-a-number": {"map": [["a", {"path": 5}]]},
    **{
        f"{name}-{value}": {"map": [*(GOOD | {name: value}).items()]}
        for name in GOOD
        for value in (5, "x", None, [[5]])
        if not (name == "aerial" and value is None) and not (name == "crs" and value == "x")
        if not (name == "part" and value is None) and not (name == "geoid_separation" and value in (5, None))
    },
    "building-of-numbers": {"map": [*(GOOD | {"buildings": [BUILDING]}).items()]},
}


@pytest.mark.parametrize("case", PARTS)
def test_a_part_of_other_values_is_refused_in_one_line(case: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="streetloom city` writes it again") as raised:
        read_city_part(part_file(tmp_path / "p.npz", PARTS[case]))
    assert "\n" not in str(raised.value)


def test_a_part_of_the_right_values_is_read(tmp_path: Path) -> None:
    found = read_city_part(part_file(tmp_path / "p.npz", {"map": [*GOOD.items()]}))
    assert (found.crs, found.extent) == ("EPSG:32635", (0, 0, 1, 1))


def test_a_part_that_unpacks_beyond_its_bound_is_refused(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "p.npz", text=np.zeros(1, np.uint8), blob=np.zeros(100_000_000, np.uint8))
    with pytest.raises(InputError, match="unpacks to over 50 times"):
        read_city_part(tmp_path / "p.npz")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("blocks: {path: ~nosuchuser}", r"blocks\.path: ~nosuchuser: there is no user ~nosuchuser"),
        ("blocks: {path: nowhere}", r"blocks\.path: .*nowhere does not exist"),
        ("buildings: {tiles: ~nosuchuser/i.json}", r"buildings\.tiles: ~nosuchuser/i\.json: there is no user"),
        ("buildings: {tiles: i.json}", r"buildings\.tiles: .*i\.json is not usable JSON"),
        ("buildings: {tiles: pipe}", r"buildings\.tiles: .*pipe is no file but a device"),
    ],
)
def test_a_path_of_a_city_file_that_leads_nowhere_is_one_line(content: str, words: str, tmp_path: Path) -> None:
    (tmp_path / "city.yaml").write_text(f"name: c\n{content}\n")
    (tmp_path / "i.json").write_bytes(DEEP)
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(InputError, match=words) as raised:
        partition_city_file(tmp_path / "city.yaml", tmp_path / "out")
    assert "\n" not in str(raised.value)


def test_values_of_environment_variables_are_not_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SECRET_PLACE", "hunter2hunter2")
    (tmp_path / "block.yaml").write_text("name: b\nbuildings: {path: '${SECRET_PLACE}/b.geojson'}\n")
    with pytest.raises(BlockFileError) as raised:
        read_block(tmp_path / "block.yaml")
    assert "hunter2" not in str(raised.value)
    assert "${SECRET_PLACE}/b.geojson does not exist; check the environment variable SECRET_PLACE" in str(raised.value)


def test_an_unset_variable_leaves_other_paths_of_the_message(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("UNSET_PLACE", raising=False)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "block.yaml").write_text("name: b\nbuildings: {path: '${UNSET_PLACE}/b.geojson'}\n")
    with pytest.raises(BlockFileError) as raised:
        read_block(tmp_path / "block.yaml")
    assert str(raised.value).startswith(
        f"{tmp_path / 'block.yaml'}: buildings.path: the environment variable UNSET_PLACE"
    )


CASES: dict[str, tuple[str, Any]] = {
    "part-list": ("block.yaml", r"part\.path: .*p\.npz holds no part of a city"),
    "part-int-values": ("block.yaml", r"part\.path: .*p\.npz holds no part of a city"),
    "part-empty-map": ("block.yaml", r"part\.path: .*p\.npz holds no part of a city"),
    "city-blocks-tilde": ("city.yaml", r"blocks\.path: ~nosuch: there is no user ~nosuch"),
    "city-tiles-deep": ("city.yaml", r"buildings\.tiles: .*i\.json is not usable JSON"),
}


@pytest.mark.parametrize("case", CASES)
def test_cases_of_the_second_trial(case: str, data: Path, tmp_path: Path) -> None:
    if not (data / "bad_inputs_2" / case).is_dir():
        pytest.skip("no bad inputs in the data folder")
    shutil.copytree(data / "bad_inputs_2" / case, tmp_path / case, copy_function=shutil.copyfile)
    (tmp_path / case / "exemplars").unlink()
    shutil.copytree(data / "bad_inputs_2" / "exemplars", tmp_path / case / "exemplars", copy_function=shutil.copyfile)
    name, words = CASES[case]
    file, out = tmp_path / case / name, tmp_path / "out"
    read = partial(read_block, file) if name == "block.yaml" else partial(partition_city_file, file, out)
    with pytest.raises(InputError, match=words):
        read()
