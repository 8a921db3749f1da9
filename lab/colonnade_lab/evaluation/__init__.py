"""Benchmarks, verification and fuzzing of designs."""
