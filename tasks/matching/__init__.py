"""Photos without names, matched to facades: found, told in a table that a person mends or confirms, taken."""
