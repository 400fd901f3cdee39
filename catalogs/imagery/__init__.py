"""Services and folders that have street pictures: what they offer of a place, and fetching it."""

# How services know who asks.
USER_AGENT = "streetloom"
