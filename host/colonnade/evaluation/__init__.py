"""Measurements: rays per cycle, sweeps, verification."""
