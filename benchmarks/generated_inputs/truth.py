"""Small blocks of known truth: buildings along a street, panoramas on it, and what a reader must find."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cache
from random import Random
from typing import Any

import numpy as np
import shapely
from pyproj import CRS, Transformer
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

STOREY_M = 3.2
FOOT_M = 0.3048
CAMERA_HEIGHT_M = 2.5


@dataclass(frozen=True)
class Place:
    """Where a block stands: the frame of its truth, other frames in metres, one in feet, one with zone-prefixed eastings."""

    name: str
    longitude: float
    latitude: float
    frame: str
    metric: tuple[str, ...]
    feet: str | None = None
    prefixed: tuple[str, float] | None = None
    geoid: float = 0.0  # m of the ellipsoid below the geoid


PLACES = (
    Place("helsinki", 24.9456, 60.1675, "EPSG:3067", ("EPSG:3067", "EPSG:3879", "EPSG:32635"), geoid=17.8),
    Place("new york", -73.9857, 40.7484, "EPSG:32618", ("EPSG:32618", "EPSG:26918"), "EPSG:2263", geoid=-32.0),
    Place("hamburg", 9.9937, 53.5511, "EPSG:25832", ("EPSG:25832",), None, ("EPSG:4647", 32e6), geoid=41.0),
    Place("sofia", 23.3219, 42.6977, "EPSG:32634", ("EPSG:32634", "EPSG:32635"), geoid=43.0),
    Place("amsterdam", 4.8952, 52.3702, "EPSG:25831", ("EPSG:28992", "EPSG:25831"), geoid=43.0),
    Place("sydney", 151.2093, -33.8688, "EPSG:7856", ("EPSG:7856", "EPSG:32756"), geoid=23.0),
)
NAMES = {
    "ascii": ("Main House", "Wow! Bar", "Bread; Butter", "Gate #5", "a=b", "=SUM(A1)", "100 %", 'O\'Neill "Pub"'),
    "latin": (
        "Hämeentie 4",
        "Straße #5",
        "Café; Bar",
        "Årsta!",
        "Señor = 1",
        "Ÿ-Haus".replace("Ÿ", "Ü"),
        "Þór",
        "Føroyar",
    ),
    "cyrillic": (
        "Улица Раковски 3",
        "Дом № 7".replace("№", "N"),
        "Театр!",
        "Хлеб; соль",
        "Аптека #1",
        "Ъгъл",
        "Щит",
        "Юг",
    ),
    "wide": ("東京ビル", "Łódź", "Ελλάδα", "قاهرة", "Zażółć!", "서울; 7", "Đà Nẵng", "ਪੰਜਾਬ"),
}


@dataclass(frozen=True)
class House:
    """Building of the truth; None for what the file of a case does not state."""

    id: str | None
    outline: BaseGeometry
    name: str | None = None
    height: float | None = None
    levels: int | None = None
    base: float | None = None
    present: bool = True


@dataclass(frozen=True)
class Camera:
    """Panorama of the truth; z is the height that the file states above its datum, None without."""

    stem: str
    x: float
    y: float
    heading: float
    z: float | None = None


@dataclass
class Case:
    """Case: what a reader must find, and how it was made. sound: nothing in it is broken or undecidable."""

    index: int
    place: Place
    houses: list[House]
    ground: float
    made: dict[str, Any] = field(default_factory=dict)
    streets: dict[str, BaseGeometry] = field(default_factory=dict)
    cameras: list[Camera] = field(default_factory=list)
    photos: list[str] = field(default_factory=list)
    uv: tuple[float, float, float, float] | None = None
    sound: bool = True
    plan: bool = False

    def break_with(self, what: str) -> None:
        """Record a break of the case."""
        self.made.setdefault("broken", []).append(what)
        self.sound = False

    def forget(self, **values: Any) -> None:
        """Drop what the file does not state."""
        self.houses = [replace(house, **values) for house in self.houses]


def draw_truth(draw: Random, index: int) -> Case:
    """Draw a place, five to eight buildings on both sides of a street, their heights, names and ids, and the streets."""
    place = draw.choice(PLACES)
    x0, y0 = transformer("EPSG:4326", place.frame).transform(place.longitude, place.latitude)
    x0, y0 = round(x0, 1) + draw.uniform(0, 300), round(y0, 1) + draw.uniform(0, 300)
    turn = draw.uniform(0, 180)
    ground = round(draw.uniform(3.0, 60.0), 1)
    names = draw.sample(NAMES[draw.choice(list(NAMES))], 8)
    prefix = draw.choice(("b", "", "DEBW_00", "id=", "a;", "№", "x!y#"))

    def put(shape: BaseGeometry) -> BaseGeometry:
        placed = shapely.affinity.translate(shapely.affinity.rotate(shape, turn, origin=(0, 0)), x0, y0)
        return shapely.transform(placed, lambda xy: np.round(xy, 2))

    houses = []
    along = [0.0, 0.0]
    for number in range(draw.randint(5, 8)):
        side = number % 2
        width, depth = draw.uniform(9, 20), draw.uniform(9, 15)
        start, front = along[side], 7.0
        corners = [(start, front), (start + width, front), (start + width, front + depth), (start, front + depth)]
        if draw.random() < 0.3:  # an L
            middle, half = start + width / 2, front + depth / 2
            corners[2:3] = [(start + width, half), (middle, half), (middle, front + depth)]
        along[side] = start + width + draw.uniform(2.0, 5.0)
        outline = Polygon(corners if not side else [(x, -y) for x, y in reversed(corners)])
        levels = draw.randint(3, 9)
        houses.append(
            House(
                f"{prefix}{100 + 7 * number}", put(outline), names[number], round(levels * STOREY_M, 2), levels, ground
            )
        )
    case = Case(index, place, houses, ground)
    length = max(along)
    case.streets = {
        f"{names[6]} street": put(shapely.LineString([(-20, 0), (length / 2, 0), (length + 20, 0)])),
        "Side Lane": put(shapely.LineString([(-6, -40), (-6, 40)])),
    }
    for number in range(3):
        x, y = shapely.get_coordinates(put(shapely.Point(length * (number + 1) / 4, 0)))[0].tolist()
        case.cameras.append(
            Camera(f"pano {number}" if draw.random() < 0.3 else f"p{number}", x, y, draw.uniform(0, 360))
        )
    case.made |= {"place": place.name, "buildings": len(houses)}
    return case


@cache
def transformer(source: str, target: str) -> Transformer:
    return Transformer.from_crs(source, target, always_xy=True)


def project(geometry: BaseGeometry, source: str, target: str) -> BaseGeometry:
    if CRS(source) == CRS(target):
        return geometry
    to = transformer(source, target)
    return shapely.transform(geometry, to.transform, interleaved=False)
