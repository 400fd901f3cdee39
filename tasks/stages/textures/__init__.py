"""Write the textures of building models, and roofs from aerial pictures, to the base layer."""
