"""Sun, sky, ambient and contact light on charts."""
