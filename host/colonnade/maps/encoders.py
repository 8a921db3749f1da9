"""The encoders of maps, by name."""

from __future__ import annotations

from typing import Literal, get_args

#: ``offline``: the best maps. ``live``: maps for a moving camera, in a thousandth of the time. Where a choice is None,
#: it is the live one, or the offline one for a layout that the live one does not write.
Encoder = Literal["offline", "live"]
ENCODERS: tuple[Encoder, ...] = get_args(Encoder)
