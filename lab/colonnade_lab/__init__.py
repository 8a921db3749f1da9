"""The laboratory: what measures the project. Its distribution is colonnade-lab."""
