"""Frames of a scene through a backend, and the reports about them."""
