"""Power: recorded traffic, its replay on gates, and the energy of each transition."""
