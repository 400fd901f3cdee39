"""Readers of perspective pictures with poses: COLMAP, OpenSfM, Agisoft Metashape, tables."""
