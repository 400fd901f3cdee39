"""The example blocks, and the public data that they are made of."""
