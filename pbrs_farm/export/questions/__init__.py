"""Questions about space and their answers, and phrases that name one thing, made from labels and meshes."""
