"""The clean mesh and what its surfaces look like: materials, textures, relief, coverage."""
