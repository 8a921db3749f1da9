"""Benchmarks, sweeps, verification and fuzzing of designs."""
