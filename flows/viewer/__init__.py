"""The local page of a run: its map, every facade stage by stage, its streets viewpoint by viewpoint, the block in 3D."""

# Where `streetloom view` serves unless told otherwise.
VIEWER_HOST, VIEWER_PORT = "127.0.0.1", 8710
