"""Refinement and checks of panorama poses, alone and jointly."""
