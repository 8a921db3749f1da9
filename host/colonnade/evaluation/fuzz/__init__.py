"""Corrupt frames: the hardware and its model must agree on them, and recover; docs/errors.md."""
