"""Netlists: the module hierarchy of a design, its synthesis, and the cost of memories."""
