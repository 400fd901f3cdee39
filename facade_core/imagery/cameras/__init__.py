"""Ground, walls and roofs from posed panoramas: occluders, exposure and agreement between cameras."""
