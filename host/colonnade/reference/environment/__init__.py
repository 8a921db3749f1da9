"""The environment in floats: what rays meet that miss the object."""
