"""Closed building bodies with openings, balconies and ledges."""
