"""Triangle meshes: mesh files, the catalog of named meshes, generated solids, and materials."""
