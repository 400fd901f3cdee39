"""GLB and OpenUSD models of textured meshes."""
