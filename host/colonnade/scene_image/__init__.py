"""The scene image: the records and maps that the hardware loads, in one file."""
