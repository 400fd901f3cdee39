"""Learned layout model in one JSON file: densities, weights, policies, priors and ranking trees."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from facade_core.core.arrays import Float64Array
from facade_core.core.errors import ModelFileError
from facade_core.core.json_model import read_json_model
from facade_core.core.json_types import JsonObject
from facade_core.core.labels import ELEMENT_CLASSES
from facade_core.core.types import LAYOUT_NETWORK_NAME, TrainedModelFiles
from facade_core.facade.layout import proposal_features
from facade_core.facade.layout.densities import (
    COMPONENT_COUNT,
    DOOR_BINS,
    MIXTURE_COUNT,
    SYMMETRY_BINS,
    TERMS,
    ScoreTermDensities,
)
from facade_core.facade.layout.proposals import ElementPriors
from facade_core.facade.layout.ranking import BoostedTrees
from facade_core.facade.layout.statistics import ELEMENT_TYPE_COUNT, LABEL_COUNT, PATTERNS

SHIPPED_LAYOUT_MODEL = Path(__file__).parent / "models" / "layouts.json"
SHIPPED_LAYOUT_NETWORK = SHIPPED_LAYOUT_MODEL.with_name(LAYOUT_NETWORK_NAME)
MODEL_FORMAT = 3
POLICY_LENGTH = 15  # parameters of a policy of the layout paper
MADE_FOR = {
    "format": MODEL_FORMAT,
    "labels": list(ELEMENT_CLASSES),
    "descriptors": proposal_features.FEATURES_VERSION,
}
_REMEDY = "fetch it again or run `streetloom train layout`"


@dataclass(frozen=True, slots=True, eq=False)
class LayoutModel:
    """Learned statistics of a database of layouts.

    Attributes
    ----------
    densities : densities of the ten terms.
    weights : (10,) weights of densities.TERMS.
    averages_terms : True if a term is the mean over its grids, False for their sum as in the paper.
    policies : (10, POLICY_LENGTH) optimal policies of the layout paper, the most different ones; no run uses them.
    label_shares : (LABEL_COUNT,) frequency of each label.
    priors : doors, shops, floors and spacings for layouts that show none.
    styles : (S, 11) styles of `layout_sampling`.
    metric_pitches : median pitches in metres.
    trees : ranking of proposed elements.
    min_probability : (LABEL_COUNT,) probability from which a proposal is selected.
    training_set : names of the training layouts.
    network : file of the layout network, which finds the windows of the first completion; None: the trees find them.
    """

    densities: ScoreTermDensities
    weights: Float64Array
    averages_terms: bool
    policies: Float64Array
    label_shares: Float64Array
    priors: ElementPriors
    styles: Float64Array
    metric_pitches: Mapping[str, float]
    trees: BoostedTrees
    min_probability: Float64Array
    training_set: tuple[str, ...]
    network: Path | None = None


@lru_cache(maxsize=1)
def default_layout_model() -> LayoutModel:
    """Return the layout model that this package ships."""
    return load_layout_model(SHIPPED_LAYOUT_MODEL)


def load_layout_model(path: str | Path) -> LayoutModel:
    """Read a layout model from its JSON file; a layout network beside it belongs to it.

    Raises
    ------
    ModelError
        If the file is missing, its checksum differs, or another version wrote it.
    """
    path = Path(path)
    record = read_json_model(path, "layout model", MADE_FOR, _REMEDY)
    try:
        model = _from_record(record["model"], tuple(record["training_set"]))
    except (KeyError, TypeError, ValueError) as error:
        raise ModelFileError(f"{path}: incomplete ({error!r}); {_REMEDY}") from error
    return replace(model, network=TrainedModelFiles(layout=path).layout_network)


def load_cached_model(path: Path) -> LayoutModel:
    """Read a layout model once for each version of its file."""
    state = path.stat()
    return _load_version(path, state.st_size, state.st_mtime_ns)


@lru_cache(maxsize=2)
def _load_version(path: Path, _size: int, _modified: int) -> LayoutModel:
    return load_layout_model(path)


def _from_record(content: JsonObject, training_set: tuple[str, ...]) -> LayoutModel:
    trees = content["trees"]
    whole = {name: np.array(trees[name], np.int64) for name in ("roots", "feature", "left", "right")}
    return LayoutModel(
        ScoreTermDensities(
            _read_array(content, "mixtures", (MIXTURE_COUNT, COMPONENT_COUNT, 5)),
            _read_array(content, "patterns", (len(PATTERNS),)),
            _read_array(content, "symmetry", (DOOR_BINS, SYMMETRY_BINS)),
            _read_array(content, "compatibility", (2**ELEMENT_TYPE_COUNT,)),
        ),
        np.array([float(content["weights"][term]) for term in TERMS]),
        bool(content["mean"]),
        _read_array(content, "policies", (None, POLICY_LENGTH)),
        _read_array(content, "labels", (LABEL_COUNT,)),
        ElementPriors(
            _read_array(content, "doors", (None, 3)),
            _read_array(content, "shops", (None, 3)),
            _read_array(content, "floors", (None, 4)),
            _read_array(content, "ratios", (16, 2)),
        ),
        _read_array(content, "styles", (None, None)),
        {name: float(value) for name, value in content["metric"].items()},
        BoostedTrees(
            **whole,
            threshold=np.array(trees["threshold"], np.float32),
            value=np.array(trees["value"], float),
            base=float(trees["base"]),
        ),
        _read_array(content, "likely", (LABEL_COUNT,)),
        training_set,
    )


def _read_array(content: JsonObject, name: str, shape: Sequence[int | None]) -> Float64Array:
    values = np.array(content[name], float)
    if values.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, values.shape, strict=True)):
        raise ValueError(f"{name} has the shape {values.shape}")
    if not np.isfinite(values).all():
        raise ValueError(f"{name} is not finite")
    return values
