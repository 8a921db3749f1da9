"""Types of what `colonnade` imports at its first use."""

from colonnade.api.scene import Scene as Scene
from colonnade.common.errors import UserError as UserError
from colonnade.device.device import Device as Device
from colonnade.device.device import ModelDevice as ModelDevice
from colonnade.device.shell_device import ShellDevice as ShellDevice
from colonnade.render.result import RenderResult as RenderResult
from colonnade.scene.prepared.device_scene import DeviceScene as DeviceScene

__version__: str
