"""Host software of the Colonnade ray-tracing accelerator: packs scenes, runs the hardware, compares pictures."""

from colonnade.common.errors import UserError

__version__ = "0.1.0"

__all__ = ["UserError", "__version__"]
