"""Static STAC 1.1 catalogue of a published snapshot, and the schemas of its extensions."""
