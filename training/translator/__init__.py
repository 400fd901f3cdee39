"""Training of the network that translates painted streets."""
