"""Refinement and checks of panorama poses, single and joint."""
