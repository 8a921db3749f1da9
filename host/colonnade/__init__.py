"""Host software of the Colonnade ray-tracing accelerator: packs scenes, runs the hardware, compares pictures.

`Scene` and the devices are the Python API (docs/api.md). They are imported at their first use.
"""

from importlib import import_module

from colonnade.common.errors import UserError

__version__ = "0.1.0"

__all__ = ["Device", "DeviceScene", "ModelDevice", "RenderResult", "Scene", "ShellDevice", "UserError", "__version__"]

_MODULES = {
    "Device": "device.device",
    "DeviceScene": "scene.prepared.device_scene",
    "ModelDevice": "device.device",
    "RenderResult": "render.result",
    "Scene": "api.scene",
    "ShellDevice": "device.shell_device",
}


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__} has no attribute {name}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
