"""Charts, streets, visibility and the scene of a block. Conventions: geometry/README.md."""
