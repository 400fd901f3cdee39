"""One file per measured promise; each prints JSON. `streetloom bench` lists and runs them."""
