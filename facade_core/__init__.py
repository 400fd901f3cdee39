"""The algorithms of Streetloom: arrays in, arrays out."""
