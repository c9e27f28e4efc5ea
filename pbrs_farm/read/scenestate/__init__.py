"""sceneState: how it is read."""
