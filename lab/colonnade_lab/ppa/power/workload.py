"""What the hardware does while its ports are recorded."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from colonnade.common.progress import Progress
from colonnade.design.config_name import Overrides
from colonnade.design.generator import GeneratedDesign
from colonnade.design.manifest import Manifest

from colonnade_lab.ppa.power.recording import Recording
from colonnade_lab.ppa.power.window import Window


@dataclass(frozen=True)
class OneColumn:
    """A design of one column.

    Attributes:
        config: Its configuration.
        overrides: Changes to the configuration, ``key.path=value``.
        design: The Verilog.
    """

    config: str
    overrides: Overrides
    design: GeneratedDesign


class Workload(ABC):
    """What the hardware does, and which modules are replayed.

    Attributes:
        modules: The traversal unit, then modules of the column that work for it.
        outer: The module that has these instances.
        cycles: Maximum number of recorded cycles.
    """

    modules: ClassVar[tuple[str, ...]]
    outer: ClassVar[str]
    cycles: int

    @abstractmethod
    def check(self, manifest: Manifest) -> None:
        """Raise a `UserError` if a design cannot do it."""

    @abstractmethod
    def run(self, column: OneColumn, recorded: GeneratedDesign, folder: Path, progress: Progress) -> Mapping[str, Any]:
        """Do it in a folder, which receives the recordings; what was done, for reports.

        Args:
            column: The design.
            recorded: The same with recorders.
            folder: The simulator's working directory.
            progress: Shows the steps.
        """

    @abstractmethod
    def window(self, recordings: Mapping[str, Recording]) -> Window:
        """The counted part of its recordings.

        Raises:
            UserError: Nothing was counted.
        """
