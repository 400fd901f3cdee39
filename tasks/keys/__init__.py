"""What results stand on: keys of units, digests of the code that makes them, and the memory that they take."""
