"""Generation of a commented city file from a map."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from catalogs.block.keys import suggest_name
from catalogs.block.paths import resolve_paths
from catalogs.block.yaml_files import parse_yaml
from catalogs.city.keys import DEFAULT_BLOCK_SIZE_M, CityFileSettings, validate_city_settings
from facade_core.core.errors import InputError
from tasks.examples.new_block import MapFiles, given_streets_frame, path_in_block_file, write_style_library

# Texels per metre of a new city: a quarter of the texels of a block's default.
TEXELS_PER_METRE = 16

_TEMPLATE = """\
# A city of Streetloom. What it takes:  streetloom plan {file}
# All keys are those of a block file, and `cut`: docs/reference/block-file.md documents them.
name: {name}

# Part of the map in degrees: west, south, east, north. Without it the whole file is the city.
{area}

buildings: {buildings}
streets: {streets}
{terrain}

# Side of a block in metres. Each block is a run of its own, cut along the streets, and publishes when it is done.
# Smaller blocks need less memory and publish sooner; each takes some seconds to start and to publish.
cut: {{metres: {block_size:g}}}

imagery:
  # Rectified pictures of facades, one a file with any name. Walls without pictures take their style.
  exemplars: {{path: {exemplars}}}
{panoramas}
  # Photos of single facades, named after the facade: photos/w123-2.jpg. `streetloom query` and `view` show the ids.
  # photos: {{path: photos}}
  # People and vehicles in stored pictures, and after `make detect-setup` faces and plates: blur, mask or keep.
  privacy: blur

texture:
  # Half as many texels a metre take about a quarter of the time and of the disk; the default of a block is 32.
  texels_per_metre: {texels}
  # Pixels of a viewpoint's panorama.
  # panorama_width: 1024
  # Position of the sun in degrees, for shadows on facades.
  # sun: {{azimuth: 145, elevation: 47}}

# Choices of exemplars and details are random by this number, and the same in every run.
seed: 0

# Schedule. A run is resumable: it ends at a time of day, and the same command goes on the next night.
#   streetloom city {file} --out {out} --at-once 2 --workers 4 --until 06:00
# `--at-once` blocks run side by side with `--workers` processes each. deploy/README.md has schedules of a server.
"""


@dataclass(frozen=True)
class CityInputs:
    """Inputs of a new city file.

    Attributes
    ----------
    map_files : buildings and streets.
    area : (west, south, east, north) in degrees; None for all of the map.
    block_size : side of a block in metres; None for the default.
    exemplars : style library; None: a painted one in the city file's folder.
    panoramas : folder of panoramas with a pose; None without.
    """

    map_files: MapFiles
    area: Sequence[float] | None
    block_size: float | None
    exemplars: Path | None
    panoramas: Path | None


def write_new_city(path: Path, inputs: CityInputs) -> CityFileSettings:
    """Write a commented city file; its map is not read.

    Parameters
    ----------
    path : new city file.

    Raises
    ------
    InputError : the file exists, a path does not, or the map has no streets; no city file is left.
    """
    if path.exists():
        raise InputError(f"{path} is there already; name another file, or remove it")
    text = format_city_file(path, inputs)
    try:
        settings = validate_city_settings(parse_yaml(text), path)
        assert isinstance(settings, CityFileSettings)
        path.parent.mkdir(parents=True, exist_ok=True)
        if inputs.exemplars is None and not (path.parent / "exemplars").exists():
            write_style_library(path.parent / "exemplars")
        resolve_paths(settings.block_keys, path)
    except ValueError as error:
        raise InputError(str(error)) from error
    with path.open("x", encoding="utf-8") as file:
        file.write(text)
    return settings


def format_city_file(path: Path, inputs: CityInputs) -> str:
    """Format the text of a city file."""

    def quote(target: Path) -> str:
        return json.dumps(path_in_block_file(target, path), ensure_ascii=False)

    def source(target: Path, crs: str | None) -> str:
        return f"{{path: {quote(target)}{f', crs: {json.dumps(crs)}' if crs else ''}}}"

    streets = inputs.map_files.streets
    if streets is None:
        raise InputError("--streets: missing, and a city is cut along its streets; give a file of them")
    area = [round(float(value), 6) for value in inputs.area or (24.94, 60.16, 24.95, 60.17)]
    about_panoramas = "  # Panoramas with a pose of their own or in a file (poses: poses.json)."
    if inputs.panoramas is None:
        box = " ".join(f"{value:g}" for value in inputs.area or ()) or "W S E N"
        panoramas = (
            f"{about_panoramas} This fetches them:\n"
            f"  #   streetloom fetch-imagery --bbox {box} --to panoramas\n  # panoramas: {{path: panoramas}}"
        )
    else:
        panoramas = f"{about_panoramas}\n  panoramas: {{path: {quote(inputs.panoramas)}}}"
    return _TEMPLATE.format(
        file=path.name,
        name=json.dumps(suggest_name(path.stem) or path.stem, ensure_ascii=False),
        area=f"{'' if inputs.area else '# '}area: {area}",
        buildings=source(inputs.map_files.buildings, inputs.map_files.crs),
        streets=source(streets, given_streets_frame(inputs.map_files).get("crs")),
        terrain="# Heights of the ground; without them it is flat.\n# terrain: {path: heights.tif}",
        block_size=DEFAULT_BLOCK_SIZE_M if inputs.block_size is None else inputs.block_size,
        exemplars=quote(inputs.exemplars or path.parent / "exemplars"),
        panoramas=panoramas,
        texels=TEXELS_PER_METRE,
        out=Path("out") / path.stem,
    )
