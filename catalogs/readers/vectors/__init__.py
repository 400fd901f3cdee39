"""Vector files and OpenStreetMap extracts: footprints and centrelines with their tags."""
