"""Scenes: the TOML file, the object's pose, cameras and the view."""
