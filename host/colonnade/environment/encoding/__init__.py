"""Encodes an environment's maps into the contents of the on-chip physical-attribute memory."""
