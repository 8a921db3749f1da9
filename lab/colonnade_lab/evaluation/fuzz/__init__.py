"""Fuzzing with corrupt frames: RTL and model must render them alike, and recover (docs/errors.md)."""
