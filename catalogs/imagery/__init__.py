"""Services and folders of street pictures: search and download."""

# How services know who asks.
USER_AGENT = "streetloom"
