"""Closed shells of buildings: extrusion, roof shapes and roof details."""
