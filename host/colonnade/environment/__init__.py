"""The environment: a photographed room as maps of albedo, normals and depth, seen from one camera."""
