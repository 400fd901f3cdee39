"""The styles as data: proportions, materials, colours and habits of each."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Style:
    """One style. Lengths in metres, shares of the storey height or of the column pitch where the name says so."""

    name: str
    wall: str  # plaster | brick | ashlar
    wall_colours: tuple[str, ...]
    trim_colours: tuple[str, ...]
    base: str  # granite | banded | ashlar | tile | brick
    base_colours: tuple[str, ...]
    frame_colours: tuple[str, ...]
    door_colours: tuple[str, ...]
    roof: str  # mansard | metal | none
    roof_height: float
    roof_colours: tuple[str, ...]
    crown: float  # height of the cornice, frieze or parapet above the top windows
    window_share: float  # of the column pitch
    window_widest: float
    window_height_share: float
    sill_share: float
    glazing: str  # jugend | cross | sash | strip | french
    surround: str  # band | brick | classical | none | keystone
    balconies: str  # few | stacks | centre | parisian
    railing: str  # iron | bars | solid | stone
    shops: float  # chance of shops on the ground floor


JUGEND = Style(
    name="jugend",
    wall="plaster",
    wall_colours=("#d6b67c", "#d3a08a", "#a9b296", "#b9b6ac", "#dccba0", "#c58f70", "#9fb0b4"),
    trim_colours=("#dfd2b4", "#d8cdb8", "#e2d8c2"),
    base="granite",
    base_colours=("#8f8b86", "#9a857a", "#7d7e82"),
    frame_colours=("#efeae0", "#33503f", "#6a3a2a", "#e4dcc8"),
    door_colours=("#6a4327", "#2f4a3c", "#4e2f22"),
    roof="metal",
    roof_height=1.1,
    roof_colours=("#5f7d72", "#7c4a3e", "#55585c"),
    crown=0.75,
    window_share=0.50,
    window_widest=1.75,
    window_height_share=0.62,
    sill_share=0.22,
    glazing="jugend",
    surround="band",
    balconies="few",
    railing="iron",
    shops=0.6,
)
BRICK = Style(
    name="brick",
    wall="brick",
    wall_colours=("#9a4a36", "#8a4031", "#a25a42", "#7d3a2c"),
    trim_colours=("#ded0b4", "#d8cdb9", "#cfc3ad"),
    base="ashlar",
    base_colours=("#a39d92", "#8e8a85", "#b0a692"),
    frame_colours=("#eeeae2", "#f0ece4", "#2e4038"),
    door_colours=("#3f2a20", "#27483f", "#5a2a22"),
    roof="none",
    roof_height=0.0,
    roof_colours=(),
    crown=0.95,
    window_share=0.46,
    window_widest=1.55,
    window_height_share=0.60,
    sill_share=0.24,
    glazing="cross",
    surround="brick",
    balconies="few",
    railing="bars",
    shops=0.5,
)
NEOCLASSICAL = Style(
    name="neoclassical",
    wall="plaster",
    wall_colours=("#e3cd94", "#dccdae", "#cfd2cf", "#e0c3a0", "#cccfbe"),
    trim_colours=("#e0d8c4", "#dcd5c6", "#e3dccd"),
    base="banded",
    base_colours=("#c9bfa9", "#bdb6a8", "#d3c8ae"),
    frame_colours=("#f4f0e6", "#e9e4d8", "#4b3a2c"),
    door_colours=("#5a3a22", "#2d4238", "#3a2c26"),
    roof="none",
    roof_height=0.0,
    roof_colours=(),
    crown=1.15,
    window_share=0.42,
    window_widest=1.4,
    window_height_share=0.58,
    sill_share=0.24,
    glazing="sash",
    surround="classical",
    balconies="centre",
    railing="stone",
    shops=0.0,
)
FUNCTIONALIST = Style(
    name="functionalist",
    wall="plaster",
    wall_colours=("#e6dfcf", "#dfd0ae", "#d3d5d0", "#e3d3bd", "#cfd6d2"),
    trim_colours=("#c9c4b8", "#bfbdb6", "#d4cdbf"),
    base="tile",
    base_colours=("#4e5250", "#6b4a3c", "#3f4a4c", "#7a7467"),
    frame_colours=("#f1efe8", "#4a3428", "#e6e3da", "#2f3a40"),
    door_colours=("#7a4a28", "#8a5a32", "#2b3338"),
    roof="none",
    roof_height=0.0,
    roof_colours=(),
    crown=0.5,
    window_share=0.66,
    window_widest=2.6,
    window_height_share=0.47,
    sill_share=0.30,
    glazing="strip",
    surround="none",
    balconies="stacks",
    railing="solid",
    shops=0.7,
)
HAUSSMANN = Style(
    name="haussmann",
    wall="ashlar",
    wall_colours=("#d6c8ac", "#d2c6b2", "#d9cdb8", "#cbbfa8"),
    trim_colours=("#dccfb4", "#d8ccb6"),
    base="banded",
    base_colours=("#cdbf9f", "#c8bca2"),
    frame_colours=("#efece2", "#e6e4dc", "#c9cfcb"),
    door_colours=("#1f3b34", "#27324a", "#5b2a22", "#3a2a20"),
    roof="mansard",
    roof_height=2.5,
    roof_colours=("#68727c", "#6d747b"),
    crown=0.6,
    window_share=0.44,
    window_widest=1.35,
    window_height_share=0.78,
    sill_share=0.04,
    glazing="french",
    surround="keystone",
    balconies="parisian",
    railing="iron",
    shops=0.85,
)

BY_NAME: dict[str, Style] = {s.name: s for s in (JUGEND, BRICK, NEOCLASSICAL, FUNCTIONALIST, HAUSSMANN)}
STYLES: tuple[str, ...] = tuple(BY_NAME)
