"""Geometry of meshes: polygons, neighbours, winding, normals, primitives."""
