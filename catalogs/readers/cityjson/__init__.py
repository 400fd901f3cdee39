"""CityJSON, whole files and sequences."""
