"""Power, performance and area of a configuration, with open tools."""
