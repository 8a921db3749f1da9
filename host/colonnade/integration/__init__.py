"""Files for those who build the device into a chip or a program: register descriptions, headers, snippets."""
