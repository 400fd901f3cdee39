"""Reading a block file: the YAML, the files it names, and what they hold, as one frozen value."""

from __future__ import annotations

import difflib
import hashlib
import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from catalogs.block_keys import BlockKeys, TextureSettings, check_keys
from catalogs.buildings import block_buildings
from catalogs.features import Centrelines
from catalogs.frames import area_outline, check_scale, named_frame, to_lonlat, utm_frame
from catalogs.geometry_files import read_centrelines, read_footprints
from catalogs.images import image_files, photos_by_facade
from catalogs.streets import block_streets
from facade_core.errors import BlockFileError, InputError
from facade_core.types import Building, Street

if TYPE_CHECKING:
    from pyproj import CRS

__all__ = ["Block", "TextureSettings", "read_block"]

T = TypeVar("T")


@dataclass(frozen=True)
class Block:
    """One city block, ready to be textured.

    crs is horizontal, projected and in metres (x east, y north); buildings and streets are in it. photos: facade id ->
    file. notes says what was set aside or assumed, one line each. digest is the sha256 of everything that determines
    the result: settings and contents of the files, not their places or dates.
    """

    name: str
    crs: CRS
    buildings: tuple[Building, ...]
    streets: tuple[Street, ...]
    exemplars: tuple[Path, ...]
    photos: dict[str, Path]
    texture: TextureSettings
    storey: float
    geoid_separation: float | None
    seed: int
    notes: tuple[str, ...]
    digest: str


def read_block(path: Path | str) -> Block:
    """Read and check a block file; the README of this package documents its keys.

    Raises BlockFileError: one line with the block file, the key, the file concerned and the remedy.
    """
    path = Path(path)
    try:
        keys = check_keys(_yaml(path))
    except ValueError as error:
        raise BlockFileError(f"{path}: {error}") from error

    def fail(key: str, problem: str) -> BlockFileError:
        return BlockFileError(f"{path}: {key}: {problem}")

    def reading(key: str, read: Callable[..., T], *arguments: Any) -> T:
        try:
            return read(*arguments)
        except OSError as error:
            raise fail(key, f"{error.filename} cannot be read ({error.strerror}); check its permissions") from error
        except InputError as error:
            raise fail(key, str(error)) from error

    _refuse_what_is_not_built(keys, fail)
    files = {key: _existing(path, key, named) for key, named in _paths(keys).items()}
    exemplars = reading("imagery.exemplars.path", image_files, files["exemplars"]) if "exemplars" in files else ()
    photos = reading("imagery.photos.path", photos_by_facade, files["photos"]) if "photos" in files else {}
    if keys.texture.walls == "exemplar" and not exemplars:
        raise fail("imagery.exemplars", "missing, but texture.walls is exemplar; write exemplars: {path: FOLDER}")

    frame = reading("crs", named_frame, keys.crs) if keys.crs else None
    footprints = reading("buildings.path", read_footprints, files["buildings"])
    centrelines = reading("streets.path", read_centrelines, files["streets"])
    for key, items in (("buildings", footprints.items), ("streets", centrelines.items)):
        if not items:
            raise fail(f"{key}.path", f"{files[key]} holds no {key}; give a file that does")
    centrelines = _named_streets(centrelines, keys.streets.names, fail)

    west, south, east, north = keys.area or _bounds(footprints.crs, (f.outline for f in footprints.items))
    middle = ((west + east) / 2, (south + north) / 2)
    notes: tuple[str, ...] = ()
    if frame is None:
        frame = reading("crs", utm_frame, *middle)
        notes = (f"crs not given: {frame.to_string()} ({frame.name}) chosen",)
    reading("crs", check_scale, frame, *middle)
    area = area_outline(keys.area, frame) if keys.area else None
    buildings, more = block_buildings(footprints, frame, area=area, storey=keys.storey)
    streets = block_streets(centrelines, frame, area=area)
    for key, found, bounds in (
        ("buildings", buildings, _bounds(footprints.crs, (f.outline for f in footprints.items))),
        ("streets", streets, _bounds(centrelines.crs, (c.line for c in centrelines.items))),
    ):
        if not found and area:
            named = " of these names" if key == "streets" and keys.streets.names else ""
            span = ", ".join(f"{value:.4f}" for value in bounds)
            raise fail("area", f"{files[key]} has no {key}{named} inside area {keys.area}; they span [{span}]")
        if not found:
            raise fail(f"{key}.path", f"{files[key]} has no {key} that can be used; give a file that does")
    return Block(
        name=keys.name,
        crs=frame,
        buildings=buildings,
        streets=streets,
        exemplars=exemplars,
        photos=photos,
        texture=keys.texture,
        storey=keys.storey,
        geoid_separation=keys.geoid_separation,
        seed=keys.seed,
        notes=notes + more,
        digest=_digest(keys, frame, (files["buildings"], files["streets"]), (exemplars, tuple(photos.values()))),
    )


def _yaml(path: Path) -> Any:
    """The content of a YAML file; ValueError in one line, with the line number where YAML itself is at fault."""
    import yaml

    try:
        text = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        raise ValueError("no such block file; check the path") from None
    except OSError as error:
        raise ValueError(f"cannot be read ({error.strerror}); name a block file") from error
    except UnicodeDecodeError:
        raise ValueError("is not UTF-8 text; a block file is YAML") from None
    try:
        _refuse_twins(yaml.compose(text, Loader=yaml.SafeLoader))
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}, column {mark.column + 1}: " if mark else ""
        problem = " ".join(str(getattr(error, "problem", None) or error).split())
        raise ValueError(f"{place}not valid YAML ({problem}); mend that line") from error


def _refuse_twins(root: Any) -> None:
    """YAML lets the last of two equal keys win in silence."""
    import yaml

    waiting, seen = [root], set()
    while waiting:
        node = waiting.pop()
        if id(node) in seen:  # anchors make a graph of it
            continue
        seen.add(id(node))
        if isinstance(node, yaml.SequenceNode):
            waiting += node.value
        elif isinstance(node, yaml.MappingNode):
            lines: dict[str, int] = {}
            for key, value in node.value:
                line = key.start_mark.line + 1
                if isinstance(key, yaml.ScalarNode) and lines.setdefault(key.value, line) != line:
                    raise ValueError(
                        f"line {line}: {key.value}: given twice (also on line {lines[key.value]}); remove one"
                    )
                waiting.append(value)


def _refuse_what_is_not_built(keys: BlockKeys, fail: Callable[[str, str], BlockFileError]) -> None:
    if keys.imagery.panoramas:
        raise fail("imagery.panoramas", "posed panoramas are not read yet; remove the key and use photos or exemplars")
    if keys.texture.translator == "neural":
        raise fail("texture.translator", "no neural model is shipped yet; write translator: swatch")


def _paths(keys: BlockKeys) -> dict[str, str]:
    named = {"buildings": keys.buildings.path, "streets": keys.streets.path}
    if keys.imagery.exemplars:
        named["exemplars"] = keys.imagery.exemplars.path
    if keys.imagery.photos:
        named["photos"] = keys.imagery.photos.path
    return named


def _existing(block: Path, key: str, named: str) -> Path:
    path = block.parent / Path(named).expanduser()
    dotted = f"imagery.{key}.path" if key in ("exemplars", "photos") else f"{key}.path"
    if not path.exists():
        near = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
        close = difflib.get_close_matches(path.name, near, n=1)
        remedy = f"did you mean {close[0]}?" if close else "paths are relative to the block file"
        raise BlockFileError(f"{block}: {dotted}: {path} does not exist; {remedy}")
    if key in ("buildings", "streets") and not path.is_file():
        raise BlockFileError(f"{block}: {dotted}: {path} is a folder; name a file in it")
    return path


def _named_streets(
    source: Centrelines, names: list[str] | None, fail: Callable[[str, str], BlockFileError]
) -> Centrelines:
    if names is None:
        return source
    known = sorted({piece.name for piece in source.items if piece.name})
    for name in names:
        if name not in known:
            close = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
            remedy = f"did you mean {close[0]}?" if close else f"known are e.g. {', '.join(known[:5])}"
            raise fail("streets.names", f"no street is named {name!r}; {remedy}")
    return Centrelines(source.crs, tuple(piece for piece in source.items if piece.name in names))


def _bounds(crs: str, geometries: Iterable[Any]) -> tuple[float, float, float, float]:
    """(west, south, east, north) in degrees."""
    import shapely

    xmin, ymin, xmax, ymax = shapely.total_bounds(list(geometries))
    return to_lonlat(crs, (float(xmin), float(ymin), float(xmax), float(ymax)))


def _digest(keys: BlockKeys, crs: CRS, geometry: Iterable[Path], images: Iterable[Iterable[Path]]) -> str:
    settings = {
        "name": keys.name,
        "crs": crs.to_string(),
        "area": keys.area,
        "streets": sorted(keys.streets.names) if keys.streets.names else None,
        "texture": asdict(keys.texture),
        "storey": keys.storey,
        "geoid_separation": keys.geoid_separation,
        "seed": keys.seed,
        "geometry": [_file_digest(path) for path in geometry],
        "images": [[(path.name, _file_digest(path)) for path in folder] for folder in images],
    }
    return hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()


def _file_digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
