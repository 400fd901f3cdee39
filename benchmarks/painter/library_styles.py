"""Styles of the shipped library besides those of a perimeter block, and its painted facades."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from benchmarks.painter.styles import FacadeStyle

TERRACE = FacadeStyle(
    name="terrace",
    wall="brick",
    wall_colours=("#8a5647", "#7a4b40", "#8f6e5c", "#6d463b", "#93806c"),
    trim_colours=("#cdc8bc", "#c6c1b4", "#d2cec4"),
    base="wall",
    base_colours=("#6f6a64", "#7d7770"),
    frame_colours=("#f2efe8", "#eeeae0", "#2f4a3f"),
    door_colours=("#2c463c", "#3a2f55", "#6b2f2a", "#2b3d55", "#4a3526"),
    roof="none",
    roof_height=0.0,
    roof_colours=(),
    crown=0.45,
    window_share=0.52,
    window_widest=1.5,
    window_height_share=0.56,
    sill_share=0.26,
    glazing="sash",
    surround="brick",
    balconies="none",
    railing="bars",
    shops=0.0,
    top="eaves",
    ground_share=1.06,
    ground_window=(0.20, 0.70),
    columns_per_door=3,
    door_width=1.05,
)
TERRACE_SHOP = replace(TERRACE, name="terrace-shop", shops=1.0, columns_per_door=0, ground_share=1.2)
SLAB = FacadeStyle(
    name="slab",
    wall="panels",
    wall_colours=("#a9a69e", "#b3aea2", "#9fa09d", "#b5aa98", "#a4a8a6"),
    trim_colours=("#8f8d88", "#9c9a94", "#b4b1aa"),
    base="wall",
    base_colours=("#6a6964", "#5d5f5f"),
    frame_colours=("#efeee9", "#5a4a3e", "#e8e6e0"),
    door_colours=("#3f4a52", "#5a3f33", "#41524a"),
    roof="none",
    roof_height=0.0,
    roof_colours=(),
    crown=0.5,
    window_share=0.62,
    window_widest=2.3,
    window_height_share=0.50,
    sill_share=0.30,
    glazing="picture",
    surround="none",
    balconies="stacks",
    railing="solid",
    shops=0.0,
    top="coping",
    ground_share=1.02,
    ground_window=(0.20, 0.70),
    columns_per_door=5,
)
SLAB_PLAIN = replace(SLAB, name="slab-plain", balconies="none", glazing="strip", window_share=0.7, window_widest=2.6)
VILLA = FacadeStyle(
    name="villa",
    wall="plaster",
    wall_colours=("#cfc8b8", "#c9bfa8", "#c4c3bd", "#cbb9a0", "#c2c6c0"),
    trim_colours=("#d6d2c8", "#d0ccc2"),
    base="wall",
    base_colours=("#8a867f", "#7b7873"),
    frame_colours=("#f3f0ea", "#5a4232", "#efece4"),
    door_colours=("#5f432f", "#2f4a44", "#6a2f2a", "#3b4a5c"),
    roof="none",
    roof_height=0.0,
    roof_colours=(),
    crown=0.35,
    window_share=0.44,
    window_widest=1.5,
    window_height_share=0.44,
    sill_share=0.30,
    glazing="cross",
    surround="thin",
    balconies="none",
    railing="bars",
    shops=0.0,
    top="eaves",
    ground_share=1.04,
    ground_window=(0.24, 0.68),
    door_width=1.1,
)
VILLA_BOARDS = replace(
    VILLA,
    name="villa-boards",
    wall="boards",
    wall_colours=("#c9c4b4", "#8e4a3c", "#c2b184", "#8d9a93", "#b9b6ae"),
    glazing="grid",
)
VILLA_BRICK = replace(
    VILLA, name="villa-brick", wall="brick", wall_colours=("#8f6250", "#9a7a62", "#7c5145"), surround="none"
)
WAREHOUSE = FacadeStyle(
    name="warehouse",
    wall="ribs",
    wall_colours=("#a7abac", "#8f979c", "#b4b2aa", "#7f8c96", "#9aa39b"),
    trim_colours=("#6f7478", "#5f656a"),
    base="wall",
    base_colours=("#84827d", "#767672"),
    frame_colours=("#5f656a", "#d9dada", "#4a4f52"),
    door_colours=("#8a9096", "#5d6f80", "#a6a49c", "#6b4a3c"),
    roof="none",
    roof_height=0.0,
    roof_colours=(),
    crown=0.5,
    window_share=0.62,
    window_widest=2.8,
    window_height_share=0.30,
    sill_share=0.46,
    glazing="strip",
    surround="flush",
    balconies="none",
    railing="bars",
    shops=0.0,
    top="coping",
    ground_share=1.22,
    ground_window=(0.26, 0.56),
    columns_per_door=2,
    door_width=3.2,
)
WAREHOUSE_BRICK = replace(
    WAREHOUSE,
    name="warehouse-brick",
    wall="brick",
    wall_colours=("#7c5145", "#8a6350", "#6f5a4c"),
    window_height_share=0.46,
    sill_share=0.30,
    glazing="grid",
    surround="none",
)
OFFICE = FacadeStyle(
    name="office",
    wall="panels",
    wall_colours=("#5a5f63", "#787c7e", "#4a4d50", "#8d8f8e", "#6b6661"),
    trim_colours=("#5c6063", "#777b7d"),
    base="wall",
    base_colours=("#4c4f51", "#5f6162"),
    frame_colours=("#3f4447", "#8a8f92", "#2f3336"),
    door_colours=("#2d3134", "#4a4f52"),
    roof="none",
    roof_height=0.0,
    roof_colours=(),
    crown=0.6,
    window_share=0.94,
    window_widest=9.0,
    window_height_share=0.74,
    sill_share=0.10,
    glazing="curtain",
    surround="flush",
    balconies="none",
    railing="bars",
    shops=0.0,
    top="coping",
    ground_share=1.25,
    ground_window=(0.12, 0.97),
)
OFFICE_BANDS = replace(
    OFFICE,
    name="office-bands",
    wall_colours=("#aaa79f", "#9a9c9c", "#8e8377"),
    window_share=0.88,
    window_height_share=0.52,
    sill_share=0.28,
)
LIBRARY_STYLES = (
    TERRACE,
    TERRACE_SHOP,
    SLAB,
    SLAB_PLAIN,
    VILLA,
    VILLA_BOARDS,
    VILLA_BRICK,
    WAREHOUSE,
    WAREHOUSE_BRICK,
    OFFICE,
    OFFICE_BANDS,
)


class LibraryFacade(NamedTuple):
    """Painted facade of the library: name of its style, floors, columns, and width of a column in metres."""

    style: str
    floors: int
    columns: int
    column_m: float


# Facades by style of the library.
LIBRARY_FACADES: dict[str, tuple[LibraryFacade, ...]] = {
    "brick-terrace": (
        LibraryFacade("terrace", 3, 3, 2.1),
        LibraryFacade("terrace", 3, 3, 1.9),
        LibraryFacade("terrace", 3, 2, 2.6),
        LibraryFacade("terrace", 3, 6, 2.0),
        LibraryFacade("terrace", 4, 3, 2.1),
        LibraryFacade("terrace-shop", 3, 3, 2.2),
        LibraryFacade("terrace-shop", 4, 3, 2.1),
    ),
    "concrete-slab": (
        LibraryFacade("slab", 4, 6, 3.0),
        LibraryFacade("slab", 7, 7, 3.0),
        LibraryFacade("slab", 5, 5, 3.3),
        LibraryFacade("slab-plain", 4, 5, 3.2),
        LibraryFacade("slab-plain", 8, 6, 3.2),
    ),
    "villa": (
        LibraryFacade("villa", 2, 3, 3.0),
        LibraryFacade("villa", 3, 4, 2.8),
        LibraryFacade("villa-boards", 2, 3, 2.9),
        LibraryFacade("villa-boards", 2, 5, 2.6),
        LibraryFacade("villa-brick", 2, 4, 2.8),
        LibraryFacade("villa-brick", 3, 3, 3.0),
    ),
    "warehouse": (
        LibraryFacade("warehouse", 2, 4, 4.6),
        LibraryFacade("warehouse", 2, 6, 4.8),
        LibraryFacade("warehouse", 3, 4, 4.6),
        LibraryFacade("warehouse-brick", 2, 4, 4.4),
        LibraryFacade("warehouse-brick", 3, 5, 4.4),
    ),
    "office-glass": (
        LibraryFacade("office", 5, 5, 3.6),
        LibraryFacade("office", 8, 5, 3.6),
        LibraryFacade("office", 4, 6, 3.0),
        LibraryFacade("office-bands", 5, 5, 3.8),
        LibraryFacade("office-bands", 7, 4, 4.0),
    ),
}
