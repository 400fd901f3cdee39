"""Assembly of the buildings of a block from the footprints and models of its sources."""
