"""Compares lines of XRGB8888 with a picture.

usage: compare.py FRAME PICTURE
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image


def main(frame: Path, picture: Path) -> None:
    """Print the number of pixels that differ; the exit status is 1 if it is not 0."""
    expected = np.asarray(Image.open(picture).convert("RGB"))
    pixels = np.frombuffer(frame.read_bytes(), dtype=np.uint8).reshape(*expected.shape[:2], 4)
    differing = int((pixels[..., 2::-1] != expected).any(axis=-1).sum())  # B, G, R, 255 in memory
    print(f"{differing} of {expected.shape[0] * expected.shape[1]} pixels differ from {picture.name}")
    sys.exit(differing > 0)


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*map(Path, sys.argv[1:]))
