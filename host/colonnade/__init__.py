"""Host of the Colonnade ray-tracing accelerator: packs scenes, runs the hardware, judges the picture."""

from colonnade.common.errors import UserError

__version__ = "0.1.0"

__all__ = ["UserError", "__version__"]
