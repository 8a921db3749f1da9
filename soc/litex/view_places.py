"""Where a view file (docs/driver.md) holds its poses, in words of 32 bits."""

OBJECT = 45
CAMERA = 60
WIDTH = 83
LIGHT = 85
