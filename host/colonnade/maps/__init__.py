"""Maps in the formats of the on-chip memories: rooms of the physical-attribute memory, and textures."""
