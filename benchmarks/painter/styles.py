"""Facade styles as data: proportions, materials, colours and ornament."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class FacadeStyle:
    """Style of painted facades: lengths in metres; shares of the floor height, or of the column pitch where noted."""

    name: str
    wall: str  # plaster | brick | ashlar | panels | ribs | boards
    wall_colours: tuple[str, ...]
    trim_colours: tuple[str, ...]
    base: str  # granite | banded | ashlar | tile | brick | wall
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
    glazing: str  # jugend | cross | sash | strip | french | grid | deco | picture | curtain
    surround: str  # band | brick | classical | none | keystone | thin | flush
    balconies: str  # few | stacks | centre | parisian | none
    railing: str  # iron | bars | solid | stone
    shops: float  # chance of shops on the ground floor
    top: str = ""  # coping | eaves; empty for a cornice of the style
    ground_share: float = 1.28  # height of the ground floor in heights of an upper floor
    ground_window: tuple[float, float] = (0.22, 0.70)  # top and bottom in heights of the ground floor
    columns_per_door: int = 0  # 0 for one door per facade
    door_width: float = 0.0  # of the doors; 0 for one that follows the columns

    @property
    def has_gates(self) -> bool:
        """True for doors that vehicles take."""
        return self.door_width > 2.0

    @property
    def is_workplace(self) -> bool:
        """True for windows with pale blinds alone."""
        return self.has_gates or self.glazing == "curtain"

    @property
    def is_modern(self) -> bool:
        """True for glazed doors under a canopy."""
        return self.glazing in ("strip", "deco", "picture", "curtain")


JUGEND = FacadeStyle(
    name="jugend",
    wall="plaster",
    wall_colours=("#bcab8b", "#ba9e92", "#989d8d", "#a3a19c", "#c2b8a1", "#ad907f", "#939c9e"),
    trim_colours=("#c4bcaa", "#beb7aa", "#c7c1b3"),
    base="granite",
    base_colours=("#7e7b78", "#887971", "#6f7072"),
    frame_colours=("#efeae0", "#33503f", "#6a3a2a", "#e4dcc8"),
    door_colours=("#5f432f", "#2f4339", "#463027"),
    roof="metal",
    roof_height=1.1,
    roof_colours=("#5b7069", "#704c43", "#4e5053"),
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
BRICK = FacadeStyle(
    name="brick",
    wall="brick",
    wall_colours=("#8c594b", "#7e4f45", "#926453", "#6e473a", "#886c58"),
    trim_colours=("#c3bba9", "#beb7ab", "#b6afa1"),
    base="ashlar",
    base_colours=("#8f8b83", "#7d7a77", "#9b9486"),
    frame_colours=("#eeeae2", "#f0ece4", "#2e4038"),
    door_colours=("#392a22", "#29413a", "#512e29"),
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
NEOCLASSICAL = FacadeStyle(
    name="neoclassical",
    wall="plaster",
    wall_colours=("#c8bc9d", "#c2b9a9", "#b7b9b7", "#c5b5a2", "#b5b6ad"),
    trim_colours=("#c5c0b4", "#c2bdb4", "#c8c3ba"),
    base="banded",
    base_colours=("#b1aa9a", "#a6a198", "#bab2a0"),
    frame_colours=("#f4f0e6", "#e9e4d8", "#4b3a2c"),
    door_colours=("#513a29", "#2c3b34", "#342a26"),
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
FUNCTIONALIST = FacadeStyle(
    name="functionalist",
    wall="plaster",
    wall_colours=("#cac7be", "#c4bcaa", "#babbb9", "#c8bfb3", "#b9bcba"),
    trim_colours=("#b1aea6", "#a8a7a3", "#bbb6ae"),
    base="tile",
    base_colours=("#454847", "#5e4a42", "#3a4143", "#6b675e"),
    frame_colours=("#f1efe8", "#4a3428", "#e6e3da", "#2f3a40"),
    door_colours=("#6e4b33", "#7c5a3d", "#292f32"),
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
HAUSSMANN = FacadeStyle(
    name="haussmann",
    wall="ashlar",
    wall_colours=("#bcb5a5", "#b9b2a7", "#bfb8ad", "#b3aca0"),
    trim_colours=("#c2baa9", "#beb7a9"),
    base="banded",
    base_colours=("#b4ab94", "#b0a895"),
    frame_colours=("#efece2", "#e6e4dc", "#c9cfcb"),
    door_colours=("#213530", "#293143", "#522f29", "#342921"),
    roof="mansard",
    roof_height=2.5,
    roof_colours=("#616870", "#656a6f"),
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

CLASSICISM = FacadeStyle(
    name="classicism",
    wall="plaster",
    wall_colours=("#b19f85", "#a58d80", "#a1998b", "#95968e", "#b4a992", "#a98d7b", "#9f9d96"),
    trim_colours=("#c2bcaf", "#bab5a9", "#b6af9e"),
    base="ashlar",
    base_colours=("#7b7873", "#857b70", "#70706e"),
    frame_colours=("#f0ebe0", "#ede7d8", "#5a4a3a"),
    door_colours=("#433327", "#323f38", "#4e382e"),
    roof="metal",
    roof_height=0.9,
    roof_colours=("#60443c", "#4d4e51", "#4a5650"),
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
ART_DECO = FacadeStyle(
    name="art-deco",
    wall="plaster",
    wall_colours=("#aca596", "#a39889", "#b3a89b", "#9a9b97", "#b7af9e"),
    trim_colours=("#a29989", "#948c80", "#a9a293"),
    base="granite",
    base_colours=("#4d4947", "#5d514b", "#444648"),
    frame_colours=("#3a2e28", "#2c3836", "#e6dfd0"),
    door_colours=("#342923", "#282a2b", "#513a2c"),
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
POST_WAR = FacadeStyle(
    name="post-war",
    wall="plaster",
    wall_colours=("#b4ab99", "#a3a298", "#b19f90", "#979b97", "#b9b2a4", "#a89a8b"),
    trim_colours=("#c9c6bf", "#c2bfb8", "#ccc8bf"),
    base="tile",
    base_colours=("#5d5b58", "#6b6056", "#525655"),
    frame_colours=("#f2efe6", "#ece8dc", "#6a4630"),
    door_colours=("#6e4b34", "#5f4d3b", "#3b4d5f"),
    roof="metal",
    roof_height=0.55,
    roof_colours=("#514541", "#4e5053", "#5f4840"),
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
PLASTER = FacadeStyle(
    name="plaster",
    wall="plaster",
    wall_colours=("#bfb194", "#b6b0a0", "#bca493", "#abaca6", "#c1b7a1", "#b1a39b"),
    trim_colours=("#c7c1b4", "#c4c0b6", "#cac5ba"),
    base="banded",
    base_colours=("#9e9684", "#949087", "#a59882"),
    frame_colours=("#4a3626", "#efeae0", "#5c4632"),
    door_colours=("#432f24", "#363d35", "#513a2e"),
    roof="metal",
    roof_height=0.8,
    roof_colours=("#484b4d", "#5f4239", "#545f5a"),
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

STYLE_BY_NAME: dict[str, FacadeStyle] = {
    s.name: s for s in (JUGEND, BRICK, NEOCLASSICAL, FUNCTIONALIST, HAUSSMANN, CLASSICISM, ART_DECO, POST_WAR, PLASTER)
}
STYLES: tuple[str, ...] = tuple(STYLE_BY_NAME)
# Styles of a northern street before 1960.
NORDIC_STYLES: tuple[str, ...] = tuple(name for name in STYLES if name != HAUSSMANN.name)
