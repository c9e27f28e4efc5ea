"""Triangle meshes: OBJ and MTL, triangulation, shading normals, level areas in plan."""
