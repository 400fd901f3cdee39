"""Digests of the values that determine the result of a block.

Parsed values are hashed, not the bytes or names of files: the order of keys does not matter, and a file that a named
file refers to does. Pictures are hashed by their bytes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import shapely

from catalogs.block.serial_schemas import BLOCK_FIELDS, SCHEMA_VERSION, SCHEMAS
from catalogs.file_digest import file_digest
from catalogs.readers.pictures.folders import picture_and_label_paths
from facade_core.core.types import TrainedModelFiles

if TYPE_CHECKING:
    from catalogs.block.reader import Block


def block_digest(block: Block) -> str:
    """Compute the sha256 of the values of a block, without its own digest.

    Names of pictures are hashed where a result shows them: a facade's source, the id of an exemplar or panorama.
    """
    material, aerial = block.roof_material, block.aerial
    values: dict[str, object] = {name: getattr(block, attribute) for name, attribute in BLOCK_FIELDS} | {
        "digest": None,
        "failed_limit": None,  # does not change the result, only whether it is made current
        "crs": block.crs.to_string(),
        "texture": replace(block.texture, roof_material=None, materials=None),
        "exemplars": [(path.stem, *map(file_digest, picture_and_label_paths(path))) for path in block.exemplars],
        "photos": [(facade, path.name, file_digest(path)) for facade, path in sorted(block.photos.items())],
        "panoramas": [
            (one.id, one.path.name, one.pose, file_digest(one.path), *([one.captured] if one.captured else ()))
            for one in block.panoramas
        ],
        "textures": list(map(file_digest, block.textures)),
        "aerial": aerial and (aerial.content, aerial.crs, aerial.frame),
        "roof_material": material and (file_digest(material[0]), material[1]),
        "materials": [(one.name, one.metres, file_digest(one.path)) for one in block.materials],
    }
    if block.part is None:  # digests of blocks without a part predate this field
        del values["part"]
    del values["corrections"]  # the same without corrections
    del values["models"]  # the same with shipped models
    del values["style"]  # the same without
    if block.style:
        values["style"] = [(path.name, file_digest(path)) for path in block.style]
    if block.models.files:
        values["models"] = model_file_digests(block.models)
    if block.corrections:
        values["corrections"] = block.corrections.digest_inputs()
    return _value_digest(values)


def model_file_digests(models: TrainedModelFiles) -> list[list[str]]:
    """Return for each model that a block names: its name and the digests of its files."""
    single = {
        "parser": TrainedModelFiles(parser=models.parser),
        "layout": TrainedModelFiles(layout=models.layout),
        "translator": TrainedModelFiles(translator=models.translator),
    }
    return [[name, *map(file_digest, model.files)] for name, model in single.items() if model.files]


# Settings of `texture` that a block's plan depends on.
PLAN_SETTINGS = (
    "texels_per_metre",
    "viewpoint_spacing",
    "viewpoint_height",
    "visibility_range",
    "panorama_width",
    "walls",
)


def plan_input_digest(block: Block) -> str:
    """Compute the sha256 of the inputs of a block's plan: geometry and settings, without panoramas."""
    texture, aerial = block.texture, block.aerial
    return _value_digest(
        {
            "crs": block.crs.to_string(),
            "buildings": block.buildings,
            "streets": block.streets,
            "ground": block.ground,
            "terrain": block.terrain,
            "aerial": aerial and (aerial.content, aerial.crs, aerial.frame),
            "texture": {name: getattr(texture, name) for name in PLAN_SETTINGS},
            "storey": block.storey,
            **({} if block.part is None else {"own": (block.part.buildings, block.part.streets)}),
        }
    )


def _value_digest(value: object) -> str:
    """Return the sha256 of a value and the schemas' version; version 1 adds nothing, to keep existing digests."""
    digest = hashlib.sha256(b"" if SCHEMA_VERSION == 1 else b"schemas %d " % SCHEMA_VERSION)
    _hash_value(value, digest.update)
    return digest.hexdigest()


def _hash_value(value: object, add: Callable[[bytes], object]) -> None:
    """Hash a value with its kind and length, so that different values give different bytes.

    Equal numbers hash equally, integer or not. Raises TypeError for unknown types, such as paths.
    """
    value = value.item() if isinstance(value, np.generic) else value
    if value is None or isinstance(value, bool | str):
        text = repr(value).encode(errors="surrogatepass")
        add(b"%d %s" % (len(text), text))
    elif isinstance(value, int | float):
        exact = abs(value) < 2**53 or isinstance(value, float)
        add(f"n{(value + 0.0).hex() if exact else value} ".encode())  # no -0
    elif isinstance(value, np.ndarray):
        add(f"a{value.dtype.str}{value.shape}".encode())
        add(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, shapely.Geometry):
        text = shapely.to_wkb(value)
        add(b"g%d " % len(text))
        add(text)
    elif (schema := SCHEMAS.get(type(value))) is not None:
        add(b"v")
        _hash_value({name: getattr(value, attribute) for name, attribute in schema.stated_fields(value)}, add)
    elif isinstance(value, Mapping):
        add(b"m%d " % len(value))
        for name, one in value.items():
            _hash_value(name, add)
            _hash_value(one, add)
    elif isinstance(value, list | tuple):
        add(b"l%d " % len(value))
        for one in value:
            _hash_value(one, add)
    else:
        raise TypeError(f"no digest of {type(value).__name__}")
