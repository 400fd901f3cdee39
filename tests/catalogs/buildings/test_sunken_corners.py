"""Single corners that pull a roof down through the wall are raised; low corners that are a roof's shape stay."""

from __future__ import annotations

import numpy as np
import pytest
from pyproj import CRS

from catalogs.buildings.assembly import assemble_buildings
from catalogs.buildings.sunken_corners import raise_sunken_corners
from catalogs.features import BuildingModel, BuildingModels
from catalogs.readers.faces import PlanarFace, triangulate_faces
from facade_core.core.types import BuildingShell

PLAN = np.array([[0.0, 0], [12, 0], [12, 10], [0, 10]])


def build_house(eaves: list[float], ridge: float | None = None, *, semantic: str = "roof") -> BuildingShell:
    """A box of four walls; its roof is one polygon, or four triangles up to a point."""
    low, high = np.column_stack([PLAN, np.zeros(4)]), np.column_stack([PLAN, eaves])
    faces = [PlanarFace([np.array([low[i - 1], low[i], high[i], high[i - 1]])], "wall") for i in range(4)]
    if ridge is None:
        faces.append(PlanarFace([high], semantic))
    else:
        point = np.array([6.0, 5, ridge])
        faces += [PlanarFace([np.array([high[i - 1], high[i], point])], semantic) for i in range(4)]
    shell = triangulate_faces([*faces, PlanarFace([low[::-1]], "ground")])
    assert shell is not None
    return shell


@pytest.mark.parametrize("semantic", ["roof", "unknown"])
@pytest.mark.parametrize("ridge", [None, 33.0])
@pytest.mark.parametrize("corner", range(4))
def test_a_corner_of_6_m_among_those_of_30_m_is_raised(corner: int, ridge: float | None, semantic: str) -> None:
    eaves = [30.0] * 4
    whole = build_house(eaves, ridge, semantic=semantic)
    eaves[corner] = 6.0
    mended, count = raise_sunken_corners(build_house(eaves, ridge, semantic=semantic))
    assert count == 1
    assert mended.vertices[mended.vertices[:, 2] > 0, 2].min() == pytest.approx(30.0)
    areas = [np.linalg.norm(_normals(shell), axis=1).sum() for shell in (whole, mended)]
    assert areas[0] == pytest.approx(areas[1]), "walls follow"


def _normals(shell: BuildingShell) -> np.ndarray:
    a, b, c = (shell.vertices[shell.triangles[:, k]] for k in range(3))
    return np.cross(b - a, c - a) / 2


@pytest.mark.parametrize(
    ("eaves", "ridge"),
    [
        ([30, 30, 30, 30], 60),  # a spire
        ([6, 6, 30, 30], None),  # a steep lean-to, with its eaves along one side
        ([6, 30, 6, 30], 40),  # a folded roof
        ([28, 30, 30, 30], None),  # crooked
        ([1.5, 30, 30, 30], None),  # down to the foot
    ],
)
def test_low_corners_that_are_a_roofs_shape_stay(eaves: list[float], ridge: float | None) -> None:
    shell = build_house(eaves, ridge)
    same, count = raise_sunken_corners(shell)
    assert count == 0
    assert same is shell


def test_raised_corners_have_a_note_by_name() -> None:
    shells = {"sound": [30.0] * 4, "sunken": [30.0, 6, 30, 30]}
    models = [
        BuildingModel(id, _move_east(build_house(eaves), 40.0 * k)) for k, (id, eaves) in enumerate(shells.items())
    ]
    found = assemble_buildings(
        [BuildingModels("EPSG:28992", tuple(models))], CRS.from_epsg(28992), area=None, floor_height=3.0
    )
    assert found.notes == ("models with single roof corners far below the others, raised to these: 1 (sunken)",)
    assert [one.height for one in found.items] == [30.0, 30.0]


def _move_east(shell: BuildingShell, metres: float) -> BuildingShell:
    moved = shell.vertices + np.array([metres, 0.0, 0.0])
    return BuildingShell(moved, shell.triangles, shell.semantic, shell.texture, shell.uv)
