"""Plots, and the generated tables of docs/performance.md."""
