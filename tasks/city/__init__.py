"""Cities: partition into blocks, a run for each block, and products over all blocks."""
