"""Triangle meshes: files, the catalog of named meshes, made-up solids, materials."""
