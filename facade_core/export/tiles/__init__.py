"""3D Tiles: quadtree, tile content and distant shells."""
