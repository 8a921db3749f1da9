"""Captures: recordings of a moving camera with depth and poses, converted to a sequence and a room."""
