"""Creation of the run of a block, with its key."""

from __future__ import annotations

import hashlib

from catalogs.block.reader import Block
from catalogs.published.folders import Folder
from catalogs.published.runs import CITY_BLOCKS_FOLDER, CITY_FILE_NAME
from facade_core.core.errors import InputError, ModelFileError
from facade_core.core.types import TrainedModelFiles
from tasks.engine.run import Run
from tasks.engine.stage_code import stage_code_digest

# In the folder of a city: the work that its blocks share.
SHARED_FOLDER = "shared"


def create_run(block: Block, out: Folder) -> Run:
    """Return the run that textures `block` into folder `out`.

    Raises
    ------
    InputError : a model of the block cannot be used.
    """
    codes = [stage_code_digest("ingest")] + ([stage_code_digest("harvest.library")] if block.style else [])
    key = hashlib.sha256("/".join([block.digest, *codes]).encode()).hexdigest()
    return Run(
        out=str(out.resolve()),  # workers may have been started elsewhere
        block=block.name,
        key=key,
        crs=block.crs.to_string(),
        settings=block.settings,
        aerial=block.aerial,
        roof_material=block.roof_material,
        materials=block.materials,
        models=_check_models(block.models),
        shared=_find_shared_folder(out.resolve()),
    )


def _find_shared_folder(out: Folder) -> str:
    """Return the folder that a block of a city shares with the others; empty outside a city."""
    city = out.parent.parent
    is_of_city = out.parent.name == CITY_BLOCKS_FOLDER and (city / CITY_FILE_NAME).is_file()
    return str(city / SHARED_FOLDER) if is_of_city else ""


def _check_models(models: TrainedModelFiles) -> TrainedModelFiles:
    """Load a block's own models. Raises InputError, with the block's key, for an unusable model."""
    from facade_core.facade.layout import model as layouts
    from facade_core.facade.texture.network_inpainting import load_inpainting_network
    from facade_core.parsing.confidence import load_calibration
    from facade_core.parsing.segmenter import load_segmenter
    from facade_core.parsing.semantic_network import load_semantic_network

    named = (
        ("parser", models.parser, load_segmenter),
        ("parser", models.parser, load_calibration),
        ("layout", models.layout, layouts.load_layout_model),
        ("segmentation", models.segmentation, load_semantic_network),
        ("inpainting", models.inpainting, load_inpainting_network),
    )
    for name, path, opens in named:
        try:
            if path is not None:
                opens(path)
        except ModelFileError as error:
            raise InputError(f"models.{name}: {error}") from error
    return models
