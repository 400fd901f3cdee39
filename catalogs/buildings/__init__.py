"""From what sources state of buildings to the buildings of a block."""
