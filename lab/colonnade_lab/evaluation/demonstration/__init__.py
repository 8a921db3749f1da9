"""The demonstration of a moving camera: a sequence with exact maps, and what its frames take (`tools/live`)."""
