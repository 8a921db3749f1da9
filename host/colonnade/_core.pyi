"""The compiled half of the host (cpp/): its users give its values their types."""

from typing import Any

def __getattr__(name: str) -> Any: ...
