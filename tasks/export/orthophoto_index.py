"""Indexes of orthophotos: a raster that shows them side by side, and STAC Collections."""

from __future__ import annotations

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING
from xml.etree import ElementTree as ET

import pystac
from pystac import Item

from catalogs.features import safe_file_stem
from catalogs.stac.facts import DataSourceFacts
from catalogs.stac.licences import common_license, license_links, licensors
from catalogs.stac.snapshot import stac_object_json
from facade_core.export.bodies.wall_plane import PLANE_WKT

if TYPE_CHECKING:
    from facade_core.export.attribution import Attribution

SHEET = "facades.vrt"
COLLECTION = "collection.json"
CATALOG = "catalog.json"
# Space between pictures of a sheet, metres.
GAP_M = 1.0
_OVERVIEWS = "2 4 8 16 32 64 128"


@dataclass(frozen=True)
class SheetPicture:
    """Raster on a sheet.

    Attributes
    ----------
    path : relative to the sheet.
    size : width and height, pixels.
    pixel_size : width and height of a pixel, metres.
    top : height of its upper edge above the foot of its row, metres.
    """

    path: str
    size: tuple[int, int]
    pixel_size: tuple[float, float]
    top: float

    @property
    def extent(self) -> tuple[float, float]:
        """Return the width and height, metres."""
        return self.size[0] * self.pixel_size[0], self.size[1] * self.pixel_size[1]


def write_row_sheet(path: Path, pictures: Sequence[SheetPicture]) -> None:
    """Write a sheet with pictures side by side in one row, at one scale, their feet on one line."""
    places, x, top = [], 0.0, max(one.top for one in pictures)
    for picture in pictures:
        places.append((x, top - picture.top))
        x += picture.extent[0] + GAP_M
    _write_sheet(path, pictures, places, x - GAP_M, top)


def write_column_sheet(path: Path, pictures: Sequence[SheetPicture]) -> None:
    """Write a sheet with pictures below each other, such as the sheets of blocks."""
    places, y = [], 0.0
    for picture in pictures:
        places.append((0.0, y))
        y += picture.extent[1] + GAP_M
    _write_sheet(path, pictures, places, max(one.extent[0] for one in pictures), y - GAP_M)


def read_sheet(path: Path, name: str) -> SheetPicture:
    """Read the size of a sheet that this program wrote, as a picture of another sheet.

    Parameters
    ----------
    path : file of the sheet.
    name : its path relative to the other sheet.
    """
    _, root = next(ET.iterparse(path, events=("start",)))
    size = (int(root.get("rasterXSize", "0")), int(root.get("rasterYSize", "0")))
    for _, element in ET.iterparse(path):
        if element.tag == "GeoTransform":
            values = [float(value) for value in (element.text or "").split(",")]
            return SheetPicture(name, size, (values[1], -values[5]), values[3])
    raise ValueError(f"{path} has no GeoTransform")


def _write_sheet(
    path: Path, pictures: Sequence[SheetPicture], places: Sequence[tuple[float, float]], width: float, top: float
) -> None:
    """Write a VRT of three bands and a mask.

    Parameters
    ----------
    places : x of the left and y of the upper edge of each picture, y down from the top of the sheet, metres.
    width : width of the sheet, metres.
    top : height of the upper edge, metres.
    """
    pixel = min(min(one.pixel_size) for one in pictures)
    lowest = max(y + one.extent[1] for one, (_, y) in zip(pictures, places, strict=True))
    columns, rows = (max(1, round(metres / pixel + 0.5)) for metres in (width, lowest))
    with path.open("w", encoding="utf-8") as file:
        file.write(f'<VRTDataset rasterXSize="{columns}" rasterYSize="{rows}">\n')
        file.write(
            f" {_element('SRS', PLANE_WKT)}\n <GeoTransform>0.0, {pixel!r}, 0.0, {top!r}, 0.0, {-pixel!r}</GeoTransform>\n"
        )
        file.write(f' <OverviewList resampling="nearest">{_OVERVIEWS}</OverviewList>\n')
        for number, colour in enumerate(("Red", "Green", "Blue"), start=1):
            file.write(f' <VRTRasterBand dataType="Byte" band="{number}">\n  <ColorInterp>{colour}</ColorInterp>\n')
            file.writelines(_sources(pictures, places, pixel, str(number)))
            file.write(" </VRTRasterBand>\n")
        file.write(' <MaskBand>\n  <VRTRasterBand dataType="Byte">\n')
        file.writelines(_sources(pictures, places, pixel, "mask,1"))
        file.write("  </VRTRasterBand>\n </MaskBand>\n</VRTDataset>\n")


def _sources(
    pictures: Sequence[SheetPicture], places: Sequence[tuple[float, float]], pixel: float, band: str
) -> Iterator[str]:
    for picture, (x, y) in zip(pictures, places, strict=True):
        (width, height), (across, down) = picture.size, picture.extent
        yield (
            '  <SimpleSource resampling="nearest">'
            f'<SourceFilename relativeToVRT="1">{_element("x", picture.path)[3:-4]}</SourceFilename>'
            f'<SourceBand>{band}</SourceBand><SourceProperties RasterXSize="{width}" RasterYSize="{height}" DataType="Byte"/>'
            f'<SrcRect xOff="0" yOff="0" xSize="{width}" ySize="{height}"/><DstRect xOff="{x / pixel:.3f}" '
            f'yOff="{y / pixel:.3f}" xSize="{across / pixel:.3f}" ySize="{down / pixel:.3f}"/></SimpleSource>\n'
        )


def _element(tag: str, text: str) -> str:
    element = ET.Element(tag)
    element.text = text
    buffer = io.StringIO()
    ET.ElementTree(element).write(buffer, encoding="unicode")
    return buffer.getvalue()


def write_orthophoto_collection(path: Path, block: str, items: Sequence[Item], attribution: Attribution) -> None:
    """Write the STAC Collection of a block's orthophotos, with links to its Items beside it."""
    sources = [DataSourceFacts(one.key, one.name, one.licence) for one in attribution.sources]
    boxes = [item.bbox for item in items if item.bbox]
    box = [*map(min, zip(*(b[:2] for b in boxes), strict=True)), *map(max, zip(*(b[2:] for b in boxes), strict=True))]
    times = [item.datetime for item in items if item.datetime]
    collection = pystac.Collection(
        _collection_id(block),
        f"Orthophotos of the facades of {block}, each in the plane of its wall",
        pystac.Extent(
            pystac.SpatialExtent([box or [-180.0, -90.0, 180.0, 90.0]]),
            pystac.TemporalExtent([[min(times, default=None), max(times, default=None)]]),
        ),
        license=common_license(sources),
        providers=licensors(sources),
        extra_fields={"streetloom:attribution": attribution.to_json()},
    )
    collection.clear_links()
    collection.add_links(license_links(sources))
    collection.add_links(
        [pystac.Link("item", f"./{safe_file_stem(item.id)}.json", "application/geo+json", item.id) for item in items]
    )
    media = "application/vnd.gdal.vrt+xml"
    collection.assets = {"sheet": pystac.Asset(f"./{SHEET}", "All facades side by side", media_type=media)}
    path.write_text(stac_object_json(collection), encoding="utf-8")


def add_to_collection(item: Item, block: str) -> None:
    """Refer from an Item to the Collection beside it."""
    item.collection_id = _collection_id(block)
    item.links.append(pystac.Link("collection", f"./{COLLECTION}", "application/json"))


def write_orthophoto_catalog(path: Path, city: str, children: Sequence[tuple[str, str]]) -> None:
    """Write the STAC Catalog of a city's orthophotos.

    Parameters
    ----------
    path : file to write.
    city : name of the city.
    children : address of the Collection of each block, and its title.
    """
    catalog = pystac.Catalog(_collection_id(city), f"Orthophotos of the facades of {city}, by block")
    catalog.clear_links()
    catalog.add_link(pystac.Link("root", f"./{CATALOG}", "application/json"))
    catalog.add_links([pystac.Link("child", href, "application/json", title) for href, title in children])
    path.write_text(stac_object_json(catalog), encoding="utf-8")


def _collection_id(name: str) -> str:
    return f"{name}-orthophotos"
