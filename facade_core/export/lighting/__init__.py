"""Relighting maps: base colour without light, normals, occlusion, roughness and emission of charts."""
