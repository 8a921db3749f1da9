"""The Python API: scenes in memory, and the devices that render them (docs/api.md)."""
