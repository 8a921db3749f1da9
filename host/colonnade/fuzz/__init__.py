"""Corrupt frames: hardware and model must agree on them, and recover; docs/errors.md."""
