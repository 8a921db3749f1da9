"""Plots and generated pages."""
