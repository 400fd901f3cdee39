"""The catalogue of a published snapshot as static STAC 1.1, and the schemas of its extensions."""
