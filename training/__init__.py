"""Training of the shipped networks and statistics; no module of a run imports it."""
