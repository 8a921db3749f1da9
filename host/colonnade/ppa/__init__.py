"""What a configuration costs: gates, memories and the slowest paths, unit by unit, with open programs only."""
