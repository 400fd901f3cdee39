"""The plan of a block: facades, identities, and the choice of exemplars and panoramas."""
