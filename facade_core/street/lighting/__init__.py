"""Light and shadow in textures: sun, sky, contact shadows and facade relief."""
