"""What was published, in the formats that others open."""
