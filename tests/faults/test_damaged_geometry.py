"""Every geometry format, damaged in every common way: one line that names the file and what to do, or what is sound of it."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from itertools import product
from pathlib import Path

import pytest

from catalogs.features import BuildingModels, CentrelinesAndGround, Footprints
from catalogs.readers.formats import read_buildings, read_centrelines
from facade_core.core.errors import InputError
from tests.faults.geometry_files import BUILDINGS, STREETS

# What is done to a file's bytes.
DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda data: b"",
    "one byte": lambda data: data[:1],
    "cut in the middle": lambda data: data[: len(data) // 2],
    "cut at its end": lambda data: data[:-3],
    "zeros": lambda data: b"\0" * len(data),
    "another format": lambda data: b"%PDF-1.7\n" + data,
    "an error page": lambda data: b"<!DOCTYPE html><html><body>404 Not Found</body></html>",
    "UTF-16": lambda data: data.decode("latin-1").encode("utf-16"),
}
# Damages after which some formats are still whole, or hold whole buildings.
HARMLESS = {"cut in the middle", "cut at its end", "another format", "UTF-16"}


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("name", [*BUILDINGS, *STREETS])
def test_a_damaged_file_is_one_line_with_its_name_and_a_remedy(name: str, damage: str, tmp_path: Path) -> None:
    path = tmp_path / name
    {**BUILDINGS, **STREETS}[name](path)
    path.write_bytes(DAMAGES[damage](path.read_bytes()))
    found = _read(path)
    if isinstance(found, str):
        assert len(found.splitlines()) == 1
        assert name in found
        assert "; " in found
        assert len(found) < 600
    else:
        assert damage in HARMLESS
        assert all("\n" not in fault.reason for fault in found.faults)


@pytest.mark.parametrize(
    ("name", "other"), product(["b.obj", "b.gpkg", "b.gml", "b.npz", "s.graphml"], [*BUILDINGS, *STREETS])
)
def test_a_file_of_one_format_under_the_name_of_another_is_refused(name: str, other: str, tmp_path: Path) -> None:
    write = {**BUILDINGS, **STREETS}[other]
    write(tmp_path / other)
    path = tmp_path / f"wrong{name[1:]}"
    path.write_bytes((tmp_path / other).read_bytes())
    found = _read(path)
    same = "".join(Path(other).suffixes[-1:]) == path.suffix or (name == "b.gml" and other == "b.gml.gz")
    assert isinstance(found, str) or same, found
    if isinstance(found, str):
        assert f"wrong{name[1:]}" in found
        assert "; " in found


def _read(path: Path) -> Footprints | BuildingModels | CentrelinesAndGround | str:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            return (read_centrelines if path.name.startswith("s.") or path.suffix == ".graphml" else read_buildings)(
                path
            )
        except InputError as error:
            return str(error)
