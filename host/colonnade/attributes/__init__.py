"""The physical-attribute memory's contents: a room's maps, clustered to fit on chip."""
