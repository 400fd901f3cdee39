"""The local page of a run: its map, every facade stage by stage, its streets viewpoint by viewpoint, the block in 3D."""
