"""Computes the frame registers of a scene, as defined in docs/numbers.md."""
