"""Street stage (street paper)."""
