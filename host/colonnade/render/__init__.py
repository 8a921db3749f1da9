"""Rendering a scene with a backend, and the reports of its frames."""
