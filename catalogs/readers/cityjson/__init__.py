"""Reader of CityJSON files and sequences."""
