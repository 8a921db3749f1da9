"""Scenes: the TOML file, the pose of the object, cameras and the view."""
