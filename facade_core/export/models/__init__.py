"""GLB and OpenUSD models of textured parts."""
