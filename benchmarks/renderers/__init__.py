"""Against other renderers: the same scenes, cameras and light."""
