"""Frames with an object in rooms whose light is known: against a path tracer, and against what phones do."""
