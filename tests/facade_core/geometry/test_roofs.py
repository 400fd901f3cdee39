"""Roof shapes are closed, stand on the footprint and have the height that they state."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
import trimesh

from facade_core.core.types import Building, Roof
from facade_core.geometry.buildings.facets import extract_shell_facets
from facade_core.geometry.buildings.roof_shapes import build_shell_with_roof
from facade_core.geometry.buildings.settings import ROOF_SHAPES

RECTANGLE = shapely.box(0, 0, 20, 10)
FOOTPRINTS = {
    "rectangle": RECTANGLE,
    "L": shapely.Polygon([(0, 0), (20, 0), (20, 8), (8, 8), (8, 18), (0, 18)]),
    "court": shapely.Polygon([(0, 0), (30, 0), (30, 20), (0, 20)], [[(10, 6), (10, 14), (20, 14), (20, 6)]]),
    "far and turned": shapely.affinity.translate(
        shapely.affinity.rotate(shapely.Polygon([(0, 0), (20, 0), (20, 8), (12, 8), (12, 12), (8, 12), (0, 18)]), 37.3),
        682000.123,
        6653000.77,
    ),
    "round": shapely.Point(0, 0).buffer(8),
    "extra corners": shapely.Polygon([(0, 0), (5, 0), (10, 0), (20, 0), (20, 5), (20, 10), (10, 10), (0, 10), (0, 5)]),
}
SHAPES = ("gabled", "hipped", "half-hipped", "pyramidal", "skillion", "gambrel", "mansard")


def building(footprint: shapely.Polygon, roof: Roof) -> Building:
    return Building("b", footprint, 6.0, "height", roof=roof)


@pytest.mark.parametrize("footprint", FOOTPRINTS)
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("across", [False, True])
def test_closed_and_between_eaves_and_ridge(shape: str, footprint: str, across: bool) -> None:
    outline = FOOTPRINTS[footprint]
    shell = build_shell_with_roof(building(outline, Roof(shape, 4.0, 77.0 if across else None, across)), 3.0)
    assert shell is not None
    mesh = trimesh.Trimesh(shell.vertices, shell.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > outline.area * 6
    top = shell.vertices[shell.triangles[shell.semantic == 1], 2]
    assert top.min() >= 9 - 1e-9
    assert top.max() <= 13 + 1e-6
    found = extract_shell_facets(shell, outline)
    corners = found.vertices[found.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(mesh.area - outline.area, abs=0.05)
    assert (found.normal[:, 2] > -1e-9).all()


@pytest.mark.parametrize(
    ("shape", "volume"),
    [
        ("gabled", 400),
        ("skillion", 400),
        ("hipped", 400 - 2 * 4 * 10 * 5 / 6),
        ("pyramidal", 800 / 3),
        ("gambrel", 800 * 0.675),  # 0.25 x 0.6 / 2 + 0.75 x 0.8
    ],
)
def test_volume_under_the_roof_of_a_rectangle(shape: str, volume: float) -> None:
    shell = build_shell_with_roof(building(RECTANGLE, Roof(shape, 4.0)), 0.0)
    assert shell is not None
    assert trimesh.Trimesh(shell.vertices, shell.triangles).volume - 1200 == pytest.approx(volume, rel=1e-6)


def test_ridge_runs_along_the_long_side_or_across() -> None:
    for across, axis in ((False, 1), (True, 0)):
        shell = build_shell_with_roof(building(RECTANGLE, Roof("gabled", 4.0, across=across)), 0.0)
        assert shell is not None
        ridge = shell.vertices[shell.vertices[:, 2] > 9.99]
        assert np.ptp(ridge[:, axis]) < 1e-6
        assert np.ptp(ridge[:, 1 - axis]) == pytest.approx((20, 10)[across])


def test_a_skillion_falls_towards_its_direction() -> None:
    shell = build_shell_with_roof(building(RECTANGLE, Roof("skillion", 4.0, direction=90.0)), 0.0)
    assert shell is not None
    east = shell.vertices[:, 0] > 19
    top = shell.vertices[:, 2] > 1
    assert shell.vertices[east & top, 2].max() == pytest.approx(6)
    assert shell.vertices[~east & top, 2].max() == pytest.approx(10)


def test_over_an_l_the_ridge_turns_with_it_and_its_ends_are_gables() -> None:
    shell = build_shell_with_roof(building(FOOTPRINTS["L"], Roof("gabled", 5.0, pitch=45.0)), 0.0)
    assert shell is not None
    # both wings are 8 m deep: the ridge is 4 m over the eaves, from one gable around the corner to the other
    ridge = np.unique(np.round(shell.vertices[shell.vertices[:, 2] > 9.99], 3), axis=0)
    assert ridge.tolist() == [[4, 4, 10], [4, 18, 10], [20, 4, 10]]


def test_what_does_not_meet_below_its_height_is_flat_there() -> None:
    shell = build_shell_with_roof(building(shapely.box(0, 0, 30, 20), Roof("hipped", 3.0, pitch=45.0)), 0.0)
    assert shell is not None
    top = shell.vertices[
        shell.triangles[(shell.semantic == 1) & (shell.vertices[shell.triangles][..., 2] > 8.99).all(1)]
    ]
    assert shapely.union_all(shapely.polygons(top[..., :2])).symmetric_difference(shapely.box(3, 3, 27, 17)).area < 1e-6


def test_ridges_run_through_party_walls() -> None:
    left, right = shapely.box(0, 0, 12, 10), shapely.box(12.05, 0, 24, 10)
    for footprint, other in ((left, right), (right, left)):
        shell = build_shell_with_roof(building(footprint, Roof("hipped", 5.0, pitch=45.0)), 0.0, [other])
        assert shell is not None
        assert trimesh.Trimesh(shell.vertices, shell.triangles, process=False).is_watertight
        ridge = shell.vertices[shell.vertices[:, 2] > 10.99]
        assert (min(ridge[:, 0]), max(ridge[:, 0])) == pytest.approx(
            ((5, 12) if footprint is left else (12.05, 19)), abs=0.03
        )


def test_other_shapes_are_left_flat() -> None:
    assert build_shell_with_roof(building(RECTANGLE, Roof("onion", 4.0)), 0.0) is None
    assert build_shell_with_roof(building(RECTANGLE, Roof("flat", 0.0)), 0.0) is None
    assert build_shell_with_roof(Building("b", RECTANGLE, 6.0, "height"), 0.0) is None


@pytest.mark.parametrize("shape", ["gabled", "hipped", "mansard"])
def test_a_roof_meets_its_walls_at_the_corners_of_the_outline(shape: str) -> None:
    # turned, so that the skeleton's lines and the outline round apart on the grid
    for degrees in (17, 31, 44):
        outline = shapely.affinity.rotate(FOOTPRINTS["L"], degrees)
        shell = build_shell_with_roof(building(outline, Roof(shape, 4.0, pitch=40.0)), 0.0)
        assert shell is not None
        corners = np.round(shapely.get_coordinates(outline)[:-1], 3)
        apart = np.linalg.norm(shell.vertices[:, None, :2] - corners[None], axis=2)
        assert not ((apart > 1e-9) & (apart < ROOF_SHAPES.weld_m)).any()
