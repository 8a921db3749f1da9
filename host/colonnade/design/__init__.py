"""Designs: configurations, the Chisel generator, and the manifest of a generated design."""
