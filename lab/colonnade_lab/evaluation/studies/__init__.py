"""Studies of accuracy, each with its command under ``colonnade study``."""
