"""3D Tiles: quadtrees, tile content and distant shells."""
