"""Material maps of lit models: albedo, normals, roughness, panes."""
