"""Where a view file (docs/view.md) holds its poses, in words of 32 bits."""

OBJECT = 44
CAMERA = 59
WIDTH = 82
LIGHT = 84
