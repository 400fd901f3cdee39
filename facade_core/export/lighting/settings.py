"""Settings of relightable materials and of light at night."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class AlbedoSettings:
    """Numbers of the shading that is divided out of pictures of walls.

    Attributes
    ----------
    cell_m : side of cells whose median brightness is fitted, metres.
    min_cells : minimum number of cells for a fit.
    regularisation : weight that pulls the field towards a flat one.
    robust_rounds : rounds of reweighting against other materials and hard shadows.
    robust_scale : residual at which a cell has half its weight, in log brightness.
    min_shading : minimum shading factor.
    max_shading : maximum shading factor.
    max_albedo : maximum base colour of a wall, of 255.
    """

    cell_m: float = 0.5
    min_cells: int = 24
    regularisation: float = 0.005
    robust_rounds: int = 6
    robust_scale: float = 0.12
    min_shading: float = 0.6
    max_shading: float = 1.6
    max_albedo: int = 242


ALBEDO = AlbedoSettings()


@dataclass(frozen=True, slots=True)
class HeightMapSettings:
    """Numbers of height maps, their normals and their occlusion.

    Attributes
    ----------
    frame_relief_m : relief of bars and frames over their panes, metres.
    max_slope : maximum slope of steps, so that normals never face away from every light.
    full_relief_contrast : relative darkness at which a texel is at the ground of a joint.
    contrast_window_m : window of the mean brightness, metres.
    full_cavity_depth_m : depth below the surroundings at which visibility is least, metres.
    cavity_window_m : half window of the surroundings, metres.
    min_cavity_visibility : least share of the sky that a texel sees.
    """

    frame_relief_m: float = 0.04
    max_slope: float = 1.6
    full_relief_contrast: float = 0.3
    contrast_window_m: float = 0.35
    full_cavity_depth_m: float = 0.2
    cavity_window_m: float = 0.25
    min_cavity_visibility: float = 0.55


HEIGHT_MAPS = HeightMapSettings()


@dataclass(frozen=True, slots=True)
class ShopInteriorSettings:
    """Numbers of the interior of a shop at night.

    Attributes
    ----------
    wall_light_top : light of the back wall below the lamps.
    wall_light_floor : light of the back wall at the floor.
    wall_falloff : share of the height over which it falls off.
    lamp_spacing_m : distance between lamps, metres.
    lamp_top : vertical position of lamps, share of the height from the top.
    lamp_height : height of a lamp, share of the height.
    lamp_width_m : width of a lamp, metres.
    lamp_light : light that a lamp adds.
    cone_light : light that its cone adds to the wall.
    shelved_share : share of shops with shelves; the others have a table.
    board_heights : shelf boards, shares of the height from the top.
    board_thickness : thickness of a board, share of the height.
    board_light : factor on the light of a board.
    goods_width_m : width of an article on a shelf, metres.
    goods_share : share of places with an article.
    goods_height_range : range of an article's height, shares of the shelf.
    goods_light_range : range of an article's brightness.
    table_top : top of a table, share of the height from the top; one lamp hangs lower above it.
    under_table_light : factor on the light below the table.
    floor_top : start of the floor, share of the height from the top.
    floor_light : factor on the light of the floor.
    """

    wall_light_top: float = 0.75
    wall_light_floor: float = 0.28
    wall_falloff: float = 0.4
    lamp_spacing_m: float = 1.3
    lamp_top: float = 0.07
    lamp_height: float = 0.035
    lamp_width_m: float = 0.1
    lamp_light: float = 0.5
    cone_light: float = 0.16
    shelved_share: float = 0.6
    board_heights: tuple[float, float, float] = (0.34, 0.56, 0.78)
    board_thickness: float = 0.018
    board_light: float = 0.35
    goods_width_m: float = 0.22
    goods_share: float = 0.8
    goods_height_range: tuple[float, float] = (0.4, 0.9)
    goods_light_range: tuple[float, float] = (0.2, 1.1)
    table_top: float = 0.68
    under_table_light: float = 0.4
    floor_top: float = 0.93
    floor_light: float = 0.6


SHOP_INTERIORS = ShopInteriorSettings()


@dataclass(frozen=True, slots=True)
class PaneSettings:
    """Numbers of glass panes and of their light at night.

    Attributes
    ----------
    pane_frame_m : width of frames around panes, metres.
    max_bar_m : maximum width of bars, metres.
    min_brighter : minimum contrast of bars brighter than the glass, of 255.
    min_darker : minimum contrast of bars darker than the glass, of 255.
    max_bar_share : pictures with a higher share of bars are ignored.
    shop_sign_share : share of a shop's height that is its sign.
    shop_plinth_share : share of a shop's height that is the wall under its panes.
    max_pane_slope : maximum slope of a pane.
    flat_width_m : width of a flat, metres.
    floor_height_m : height of a floor, metres.
    place_step_m : steps in which positions of windows are counted, metres, so that the same ones are lit at any
        density.
    lit_flat_share_range : range of the share of lit flats in a building.
    lit_window_share : share of lit windows in a lit flat.
    dim_floor_share : share of floors with fewer lit flats.
    dim_floor_factor : factor on the share of lit flats on such a floor.
    lit_shop_share : share of lit shops.
    window_light_range : range of a window's brightness.
    shop_light_range : range of a lit shop's brightness.
    closed_shop_light : brightness of a closed shop.
    shop_lamps : lamps of shops, as indices into LAMP_COLOURS.
    shop_lamp_cumulative_shares : cumulative shares of the lamps of shops.
    window_picture_share : share of a window's light that follows the brightness of its picture.
    shop_picture_share : share of a shop's light that follows the brightness of its picture.
    side_curtain_share : share of lit windows with curtains at their sides.
    drawn_curtain_share : share of lit windows with drawn curtains.
    blind_share : share of lit windows with a blind half down.
    """

    pane_frame_m: float = 0.06
    max_bar_m: float = 0.16
    min_brighter: int = 26
    min_darker: int = 22
    max_bar_share: float = 0.6
    shop_sign_share: float = 0.2
    shop_plinth_share: float = 0.1
    max_pane_slope: float = 0.012
    flat_width_m: float = 6.5
    floor_height_m: float = 3.2
    place_step_m: float = 0.5
    lit_flat_share_range: tuple[float, float] = (0.3, 0.65)
    lit_window_share: float = 0.8
    dim_floor_share: float = 0.2
    dim_floor_factor: float = 0.3
    lit_shop_share: float = 0.85
    window_light_range: tuple[float, float] = (0.2, 0.7)
    shop_light_range: tuple[float, float] = (0.5, 0.8)
    closed_shop_light: float = 0.1
    shop_lamps: tuple[int, int, int] = (0, 2, 3)
    shop_lamp_cumulative_shares: tuple[float, float, float] = (0.5, 0.88, 1.0)
    window_picture_share: float = 0.3
    shop_picture_share: float = 0.35
    side_curtain_share: float = 0.28
    drawn_curtain_share: float = 0.17
    blind_share: float = 0.15


PANES = PaneSettings()


@dataclass(frozen=True, slots=True)
class StreetLightSettings:
    """Numbers of the light of lamps and windows on ground and walls at night.

    Attributes
    ----------
    lamp_power : linear light of a lantern times its area, square metres, before `emissive_strength` of models.
    lantern_m : distance of the middle of a lantern from the end of its arm, metres.
    reach_m : distance beyond which no emitter lights a surface, metres.
    window_reach_m : the same for windows, from the box of a ground chart.
    window_height_m : height of a wall over its foot whose windows light the ground, metres.
    cell_m : side of the cells of lit windows, and step of the grid of light, metres.
    """

    lamp_power: tuple[float, float, float] = (24.0, 18.0, 11.0)
    lantern_m: float = 0.3
    reach_m: float = 16.0
    window_reach_m: float = 6.0
    window_height_m: float = 4.5
    cell_m: float = 0.8


STREET_LIGHT = StreetLightSettings()
