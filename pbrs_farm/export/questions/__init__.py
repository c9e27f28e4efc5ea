"""Questions about space and referring expressions, made from labels and meshes."""
