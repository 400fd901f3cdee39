"""Parse, complete and measure each exemplar picture."""
