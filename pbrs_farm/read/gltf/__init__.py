"""glTF 2.0 scenes (.glb, .gltf) -> House."""
