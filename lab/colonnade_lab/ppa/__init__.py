"""Power, performance (timing) and area of a configuration, estimated with open tools."""
