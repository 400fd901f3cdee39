"""What changed between two pictures of a facade, on facades whose changes are known."""
