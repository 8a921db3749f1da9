"""Clips: meshes that bend over time."""
