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
    glazing: str  # jugend | cross | sash | strip | french | grid | deco | picture
    surround: str  # band | brick | classical | none | keystone | thin
    balconies: str  # few | stacks | centre | parisian | none
    railing: str  # iron | bars | solid | stone
    shops: float  # chance of shops on the ground floor

    @property
    def modern(self) -> bool:
        """Whether its doors are glazed and stand under a canopy."""
        return self.glazing in ("strip", "deco", "picture")


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
    wall_colours=("#93503e", "#85473a", "#9a5d47", "#74402f", "#8f6a50"),
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

CLASSICISM = Style(
    name="classicism",
    wall="plaster",
    wall_colours=("#c9a979", "#bb8f78", "#b7a88f", "#a9aa9c", "#cdb98e", "#c08c6c", "#b5b0a4"),
    trim_colours=("#dcd3bd", "#d3cbb8", "#cfc3a8"),
    base="ashlar",
    base_colours=("#8c8880", "#97897a", "#7f7f7d"),
    frame_colours=("#f0ebe0", "#ede7d8", "#5a4a3a"),
    door_colours=("#4a3424", "#34463c", "#57382a"),
    roof="metal",
    roof_height=0.9,
    roof_colours=("#6b4438", "#54565a", "#4f5f58"),
    crown=0.7,
    window_share=0.40,
    window_widest=1.3,
    window_height_share=0.53,
    sill_share=0.27,
    glazing="grid",
    surround="thin",
    balconies="few",
    railing="bars",
    shops=0.3,
)
ART_DECO = Style(
    name="art-deco",
    wall="plaster",
    wall_colours=("#c4b69a", "#b9a58a", "#cbb8a0", "#aeb0a8", "#d0c2a2"),
    trim_colours=("#b8aa90", "#a89c88", "#c0b49c"),
    base="granite",
    base_colours=("#57524f", "#6a5850", "#4c4f52"),
    frame_colours=("#3a2e28", "#2c3836", "#e6dfd0"),
    door_colours=("#3a2a22", "#2b2f30", "#5a3a26"),
    roof="none",
    roof_height=0.0,
    roof_colours=(),
    crown=1.0,
    window_share=0.56,
    window_widest=2.1,
    window_height_share=0.54,
    sill_share=0.25,
    glazing="deco",
    surround="none",
    balconies="none",
    railing="bars",
    shops=0.8,
)
POST_WAR = Style(
    name="post-war",
    wall="plaster",
    wall_colours=("#cdbb9a", "#b9b7a6", "#c9a98c", "#a8b0a8", "#d2c6ac", "#bfa58a"),
    trim_colours=("#e4e0d4", "#dcd8cc", "#e8e2d2"),
    base="tile",
    base_colours=("#6a6762", "#7a6a5c", "#5c6260"),
    frame_colours=("#f2efe6", "#ece8dc", "#6a4630"),
    door_colours=("#7a4a2a", "#6a5038", "#38506a"),
    roof="metal",
    roof_height=0.55,
    roof_colours=("#5a4a44", "#55585c", "#6a4a3e"),
    crown=0.35,
    window_share=0.46,
    window_widest=1.9,
    window_height_share=0.46,
    sill_share=0.31,
    glazing="picture",
    surround="thin",
    balconies="stacks",
    railing="bars",
    shops=0.4,
)
PLASTER = Style(
    name="plaster",
    wall="plaster",
    wall_colours=("#d9c08a", "#cfc3a6", "#d6a98a", "#c2c4b8", "#dbc9a0", "#c9b0a0"),
    trim_colours=("#e2d9c4", "#dfd8c8", "#e6decb"),
    base="banded",
    base_colours=("#b3a88f", "#a8a296", "#bba98a"),
    frame_colours=("#4a3626", "#efeae0", "#5c4632"),
    door_colours=("#4a2f20", "#3a4438", "#5a3a2a"),
    roof="metal",
    roof_height=0.8,
    roof_colours=("#4f5356", "#6a4034", "#5a6a62"),
    crown=1.0,
    window_share=0.40,
    window_widest=1.3,
    window_height_share=0.61,
    sill_share=0.21,
    glazing="cross",
    surround="keystone",
    balconies="none",
    railing="iron",
    shops=0.35,
)

BY_NAME: dict[str, Style] = {
    s.name: s for s in (JUGEND, BRICK, NEOCLASSICAL, FUNCTIONALIST, HAUSSMANN, CLASSICISM, ART_DECO, POST_WAR, PLASTER)
}
STYLES: tuple[str, ...] = tuple(BY_NAME)
# The families of a northern street of before 1960.
NORDIC: tuple[str, ...] = tuple(name for name in STYLES if name != HAUSSMANN.name)
