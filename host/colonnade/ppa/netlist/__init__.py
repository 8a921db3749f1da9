"""Netlists: the modules of a design, their synthesis, and what is added for memories."""
