"""A scene as a design renders it: with an image and registers."""
