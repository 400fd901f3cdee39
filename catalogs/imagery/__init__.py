"""Services and folders of street pictures: search and download."""

USER_AGENT = "streetloom"
