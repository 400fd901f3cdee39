"""Data files that modules load: their content counts in the code digests of the stages that reach these modules."""

from __future__ import annotations

from collections.abc import Mapping

# By module, paths from the root of the packages.
DATA_FILES: Mapping[str, tuple[str, ...]] = {
    "catalogs.block.geoid": ("catalogs/block/egm96.npz",),
    "catalogs.published.report": (
        "catalogs/published/counted.j2",
        "catalogs/published/report.css",
        "catalogs/published/report.html.j2",
        "catalogs/published/report_exemplars.html.j2",
        "catalogs/published/report_street.html.j2",
    ),
    "catalogs.readers.vectors.column_names": ("catalogs/readers/vectors/column_names.toml",),
    "facade_core.facade.layout.model": (
        "facade_core/facade/layout/models/layouts.json",
        "facade_core/facade/layout/models/layout_network.json",
        "facade_core/facade/layout/models/layout_network.onnx",
    ),
    "facade_core.facade.variation.window_types": ("facade_core/facade/variation/models/window_types.json",),
    "facade_core.parsing.network": (
        "facade_core/parsing/models/network.json",
        "facade_core/parsing/models/network.onnx",
    ),
    "facade_core.street.materials.grain_file": (
        "facade_core/street/materials/models/materials.json",
        "facade_core/street/materials/models/materials.npz",
    ),
}
# Files and folders that no stage of a run loads.
NOT_LOADED_BY_STAGES = (
    "catalogs/examples/blocks/",
    "catalogs/examples/painted/",
    "catalogs/stac/schemas/",
    "tasks/city/cost.json",
)
