"""Settings of tiles."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ShellSettings:
    """Numbers of the simplified shells of distant buildings.

    Attributes
    ----------
    ray_start_m : start of rays before a wall of the shell, metres.
    max_ray_behind_m : maximum distance of a hit behind the wall, metres.
    min_edge_distance_m : minimum distance of rays from the edge of a wall or roof, metres.
    samples_per_texel : rays per texel and axis.
    outline_tolerance_m : tolerance of simplified outlines, metres.
    gap_closing_m : gaps up to twice this between parts of a building are closed, metres.
    min_courtyard_m2 : smaller courtyards are closed, m2.
    roof_share : share of the roof area below the top of the shell.
    max_deviation_m : maximum distance between roofs and shell, metres; other buildings keep their own surfaces.
    min_roof_triangle_m2 : smaller roof triangles, such as those of chimneys, are ignored, m2.
    """

    ray_start_m: float = 2.0
    max_ray_behind_m: float = 12.0
    min_edge_distance_m: float = 0.03
    samples_per_texel: int = 3
    outline_tolerance_m: float = 1.0
    gap_closing_m: float = 0.01
    min_courtyard_m2: float = 16.0
    roof_share: float = 0.7
    max_deviation_m: float = 4.0
    min_roof_triangle_m2: float = 0.5


FAR_SHELLS = ShellSettings()


@dataclass(frozen=True, slots=True)
class GridSettings:
    """Numbers of the grid of a published block.

    Attributes
    ----------
    max_cell_m : side of the largest cells, metres; more distant members never share a tile.
    min_cell_m : minimum side of a cell, metres.
    bytes_per_texel : encoded bytes per texel, with gutters and unused space: 0.12 in the demo, twice that on
        photographed walls.
    max_tile_bytes : maximum size of a tile, bytes.
    """

    max_cell_m: float = 1024.0
    min_cell_m: float = 1.0
    bytes_per_texel: float = 0.25
    max_tile_bytes: int = 32_000_000


TILE_GRIDS = GridSettings()


@dataclass(frozen=True, slots=True)
class CellSettings:
    """Numbers of the cells of 3D Tiles.

    Attributes
    ----------
    max_coarse_tile_texels : maximum texels of a coarse tile: a page of 2048 square.
    division_factor : a cell is divided above this multiple of `max_coarse_tile_texels`.
    max_leaf_factor : undivided quadrants share a tile up to this multiple of `max_coarse_tile_texels`.
    coarse_scale : maximum scale of the texels per metre in coarse tiles.
    max_depth : maximum depth of the quadtree.
    """

    max_coarse_tile_texels: int = 2048**2
    division_factor: float = 2.0
    max_leaf_factor: float = 2.5
    coarse_scale: float = 0.25
    max_depth: int = 12


TILE_CELLS = CellSettings()


@dataclass(frozen=True, slots=True)
class OverviewSettings:
    """Numbers of the overview of a block.

    Attributes
    ----------
    max_overview_bytes : maximum size of an overview, bytes.
    max_geometry_share : share of the size that geometry may take.
    vertex_bytes : size of a vertex with texture coordinates, bytes.
    triangle_bytes : size of a triangle at most, bytes.
    pixel_bytes : size of an encoded pixel of coarse textures, bytes.
    """

    max_overview_bytes: int = 8_000_000
    max_geometry_share: float = 0.5
    vertex_bytes: int = 20
    triangle_bytes: int = 12
    pixel_bytes: float = 0.15


OVERVIEW_MODEL = OverviewSettings()


@dataclass(frozen=True, slots=True)
class TextureBudget:
    """Numbers of the textures that a view may hold.

    Attributes
    ----------
    view_radius_m : radius around a view with the finest tiles, metres; beyond it, tiles are coarse.
    max_scale_step : largest factor of one reduction of texels until a view fits.
    """

    view_radius_m: float = 300.0
    max_scale_step: float = 0.97


TEXTURE_BUDGET = TextureBudget()
