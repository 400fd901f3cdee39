"""The pipeline of one facade: layout, texture and variation."""
