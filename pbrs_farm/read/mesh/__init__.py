"""Triangle meshes: OBJ and MTL, triangulation, shading normals, primitive solids."""
