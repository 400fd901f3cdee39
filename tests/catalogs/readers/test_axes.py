"""Names of frames, the order of their axes and their units, on places whose coordinates are known."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from catalogs.readers.axes import EARTH_RADIUS_M, CoordinateAxes, resolve_crs_axes
from facade_core.core.errors import InputError

FILE = Path("city.gml")
FOOT = 1200 / 3937  # m; US survey foot
COMPOUND = "http://www.opengis.net/def/crs-compound?1=http://www.opengis.net/def/crs/EPSG/0/{}&2=http://www.opengis.net/def/crs/EPSG/0/{}"


@pytest.mark.parametrize(
    ("name", "crs", "horizontal"),
    [
        ("EPSG:28992", "EPSG:28992", "EPSG:28992"),
        (" epsg:28992 ", "EPSG:28992", "EPSG:28992"),
        ("28992", "EPSG:28992", "EPSG:28992"),
        ("EPSG:7415", "EPSG:7415", "EPSG:28992"),
        ("EPSG:28992+5709", "EPSG:28992+5709", "EPSG:28992"),
        ("EPSG:5709+28992", "EPSG:28992", "EPSG:28992"),
        ("urn:ogc:def:crs:EPSG::28992", "EPSG:28992", "EPSG:28992"),
        ("urn:ogc:def:crs:EPSG:9.8.4:7415", "EPSG:7415", "EPSG:28992"),
        ("urn:ogc:def:crs,crs:EPSG::28992,crs:EPSG::5709", "EPSG:28992+5709", "EPSG:28992"),
        ("https://www.opengis.net/def/crs/EPSG/0/28992", "EPSG:28992", "EPSG:28992"),
        ("http://www.opengis.net/gml/srs/epsg.xml#28992", "EPSG:28992", "EPSG:28992"),
        (COMPOUND.format(28992, 5709), "EPSG:28992+5709", "EPSG:28992"),
        ("urn:adv:crs:ETRS89_UTM33*DE_DHHN2016_NH", "EPSG:25833+7837", "EPSG:25833"),
        ("urn:adv:crs:DE_DHDN_3GK4*DE_DHHN92_NH", "EPSG:31468+5783", "EPSG:31468"),
        ("urn:ogc:def:crs:OGC:1.3:CRS84", "EPSG:4326", "EPSG:4326"),
        (COMPOUND.format(4937, 7837), "EPSG:4937", "EPSG:4937"),  # a system of three axes has no compound
    ],
)
def test_spellings(name: str, crs: str, horizontal: str) -> None:
    axes, remark = resolve_crs_axes(name, None, FILE)
    assert (axes.crs, axes.horizontal_crs, remark) == (crs, horizontal, None)


@pytest.mark.parametrize("name", ["my town", "EPSG:", "EPSG:999999", "EPSG:5709", "EPSG:12345678", "EPSG:28992+999999"])
def test_names_that_are_not_understood(name: str) -> None:
    assert resolve_crs_axes(name, (1.0, 2.0), FILE) == (CoordinateAxes(), "names of a CRS that are not understood")


@pytest.mark.parametrize("name", [None, ""])
def test_no_name_is_no_remark(name: str | None) -> None:
    assert resolve_crs_axes(name, (1.0, 2.0), FILE) == (CoordinateAxes(), None)


def test_geocentric_frames_are_refused() -> None:
    with pytest.raises(InputError, match=r"city\.gml is in geocentric EPSG:4978; reproject"):
        resolve_crs_axes("EPSG:4978", None, FILE)


SWAPPED, FAR = "frames whose axes are swapped", "frames far from the area they are made for"
ASSUMED = "frames whose first axis is taken to be north, as EPSG defines them"


@pytest.mark.parametrize(
    ("name", "place", "north_first", "remark"),
    [
        ("urn:ogc:def:crs:EPSG::6697", (35.5, 139.8), True, None),
        ("urn:ogc:def:crs:EPSG::6697", (139.8, 35.5), False, SWAPPED),
        ("EPSG:6697", (35.5, 139.8), True, None),  # the other order is no place
        ("EPSG:4326", (48.7, 11.4), True, ASSUMED),
        ("4326", (48.7, 11.4), True, ASSUMED),
        ("urn:ogc:def:crs:EPSG::4326", (48.7, 11.4), True, None),
        ("urn:ogc:def:crs:OGC:1.3:CRS84", (11.4, 48.7), False, None),
        ("urn:ogc:def:crs:OGC:1.3:CRS84", (35.5, 139.8), True, SWAPPED),
        ("EPSG:31468", (5_333_000.0, 4_468_000.0), True, None),
        ("EPSG:31468", (4_468_000.0, 5_333_000.0), False, SWAPPED),
        ("EPSG:25832", (690_000.0, 5_400_000.0), False, None),
        ("EPSG:25832", (5_400_000.0, 690_000.0), True, SWAPPED),
        ("EPSG:25832", (825_000.0, 5_390_000.0), False, None),  # Passau, beyond the zone but surveyed in it
        ("EPSG:25832", (0.0, 0.0), False, FAR),
        ("EPSG:28992", (1e300, 1e300), False, FAR),
        ("EPSG:3414", (30_000.0, 28_000.0), True, ASSUMED),
        ("EPSG:3414", (0.0, 0.0), True, FAR),  # Singapore is 50 km wide: next to it is far
        ("EPSG:6318", (52.0, 179.0), True, None),  # an area across the antimeridian
    ],
)
def test_order_of_axes(name: str, place: tuple[float, float], north_first: bool, remark: str | None) -> None:
    axes, said = resolve_crs_axes(name, place, FILE)
    assert (axes.north_first, said) == (north_first, remark)


@pytest.mark.parametrize(
    ("name", "scale", "vertical"),
    [
        ("EPSG:28992", 1.0, 1.0),
        ("EPSG:7415", 1.0, 1.0),
        ("EPSG:2263", FOOT, FOOT),  # a survey in feet measures heights in feet too
        ("EPSG:2263+6360", FOOT, FOOT),
        ("EPSG:2263+5703", FOOT, 1.0),
        ("EPSG:26918+6360", 1.0, FOOT),
    ],
)
def test_units_of_projected_frames(name: str, scale: float, vertical: float) -> None:
    axes, _ = resolve_crs_axes(name, None, FILE)
    assert axes.metres_per_unit == pytest.approx((scale, scale))
    assert axes.metres_per_height_unit == pytest.approx(vertical)


@pytest.mark.parametrize(
    ("name", "place"),
    [("urn:ogc:def:crs:EPSG::6697", (35.5, 139.8)), ("urn:ogc:def:crs:EPSG::6697", (139.8, 35.5)),
     ("EPSG:4979", (35.5, 139.8)), ("OGC:CRS84", (139.8, 35.5))],
)  # fmt: skip
def test_units_of_degrees(name: str, place: tuple[float, float]) -> None:
    axes, _ = resolve_crs_axes(name, place, FILE)
    degree = EARTH_RADIUS_M * math.pi / 180
    assert axes.metres_per_unit == pytest.approx((degree * math.cos(math.radians(35.5)), degree))
    assert axes.metres_per_height_unit == 1.0


def test_points_come_out_east_first_in_metres_of_height() -> None:
    points = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    assert CoordinateAxes().to_east_north_up(points).tolist() == points.tolist()
    feet = CoordinateAxes(north_first=True, metres_per_height_unit=0.5)
    assert feet.to_east_north_up(points).tolist() == [[2.0, 1.0, 1.5], [5.0, 4.0, 3.0]]
