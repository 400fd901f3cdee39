"""Light and shadow in textures: sun, sky, reflections and facade relief."""
