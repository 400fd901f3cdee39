"""Views at eye height of what a run has published."""
