"""The command line, and how it looks and ends in a terminal."""
