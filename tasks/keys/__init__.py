"""What results stand on: keys of units, and digests of the code that makes them."""
