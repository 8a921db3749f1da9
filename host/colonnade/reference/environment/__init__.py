"""The environment in the float reference: depth mesh, ray march, and decoded maps."""
