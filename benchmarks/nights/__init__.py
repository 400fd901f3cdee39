"""Nights of a Prefect deployment whose clock is set forward."""
