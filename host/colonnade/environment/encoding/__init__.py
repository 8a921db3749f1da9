"""The contents of the physical-attribute memory: the maps of an environment, clustered to fit on chip."""
