"""CityGML, read as a stream."""
