"""Readers of mesh files, by format."""
