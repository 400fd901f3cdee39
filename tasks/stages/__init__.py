"""The stages of a run in their order: which units are due, and the tasks that do them."""
