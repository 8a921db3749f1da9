"""The scene image: one file with the records and maps that the hardware loads."""
