"""What a design with caches reads from the simulator's DRAM for any value of ``dram.page``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from colonnade.common.framebuffer import Frame
from colonnade.design.manifest import Manifest
from colonnade.scene_image.dram_image import PAGE_BYTES, line_layout

from colonnade_lab.evaluation.fuzz.cases import Case

#: The register of the page in which the records begin.
PAGE = "dram.page"


def as_read(case: Case, manifest: Manifest) -> Case:
    """The case with the records that the device reads: those from its page on."""
    page = case.registers.get(PAGE, 0)
    if page == 0:
        return case
    line = line_layout(manifest)
    first = page * PAGE_BYTES // line["pitch"] * line["records"]
    records = case.image.records[first:]
    if not len(records):
        records = np.zeros_like(case.image.records[:1])
    return replace(case, image=replace(case.image, records=records))


def with_failed_reads(frame: Frame, case: Case, manifest: Manifest) -> Frame:
    """The model's frame, with the error of a DRAM that ends before the first record."""
    page = case.registers.get(PAGE, 0)
    if page == 0:
        return frame
    line = line_layout(manifest)
    # The simulator's DRAM holds as many records as the design can address, and one more line
    lines = -(-int(manifest.memories["columnBvh"]["depth"]) // line["records"]) + 1
    if page * PAGE_BYTES < lines * line["pitch"] or not frame.counters["nodeReads"]:
        return frame
    return replace(frame, errors=[*frame.errors, "memory"])
