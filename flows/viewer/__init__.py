"""Local web page of a run: map, facades stage by stage, streets by viewpoint, and the block in 3D."""

# Default address of `streetloom view`.
VIEWER_HOST, VIEWER_PORT = "127.0.0.1", 8710
