"""Cities: cut into blocks that are run one by one, and what is published over all of them."""
