"""The jobs of a study's points, and the points' entries in ``study.json`` made of the results."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from colonnade.common.errors import UserError
from colonnade.common.input_files import read_input
from colonnade.common.limits import MAX_LIBERTY_BYTES
from colonnade.common.progress import QUIET, Progress
from colonnade.common.published import LIBRARIES
from colonnade.design.config_name import find_configuration
from colonnade.design.frame_limits import check_size
from colonnade.design.manifest import Manifest
from colonnade.design.toolchain import project_root
from colonnade.device.cycle_model import knows_design

from colonnade_lab.explore import figures
from colonnade_lab.explore.frames import Frame, counted_job, cycles_job
from colonnade_lab.explore.jobs import KINDS, Job, JobFailed
from colonnade_lab.explore.points import Point, config_of
from colonnade_lab.explore.result import figures_of
from colonnade_lab.explore.schedule import Outcome
from colonnade_lab.explore.study import quoted
from colonnade_lab.explore.study_file import StudyFile
from colonnade_lab.explore.work import PICTURE
from colonnade_lab.explore.workload import frames_of
from colonnade_lab.ppa.library.one_library import library_files

#: The library of Yosys's generic gates.
GENERIC = "yosys"

#: Sections of a configuration that do not change a picture.
_ARRAY_SECTIONS = ("array", "units", "columnBvhMemory")


class Plan:
    """The workload and the libraries of a study, read and checked, and the jobs of each point."""

    def __init__(self, file: StudyFile, libraries: Mapping[str, Sequence[str]], progress: Progress = QUIET) -> None:
        """Read scenes, meshes and libraries.

        Args:
            file: The study.
            libraries: Liberty files or folders by the library's name.
            progress: Shows the steps.

        Raises:
            UserError: A scene, mesh or library is missing or wrong; with the line of the study.
        """
        self.file = file
        self.study = file.study
        with progress.step("loading scenes and meshes"):
            self.frames = frames_of(file)
        measures_gates = bool(self.study.area or self.study.power)
        self.libraries = self.study.libraries or ((GENERIC,) if measures_gates else ())
        self._contents = {name: _library(file, name, libraries) for name in self.study.libraries}
        self._digests = {
            name: {file: hashlib.sha256(data).hexdigest() for file, data in content.items()}
            for name, content in self._contents.items()
        }
        source = find_configuration(config_of(file), file.study.design.set, project_root())
        # A precision as the configuration's name is an override of its preset
        self._config, self._base = source.path.read_text(), source.overrides
        self._prefix = len(file.study.design.set)

    @property
    def has(self) -> dict[str, bool]:
        """What is measured."""
        study = self.study
        return {
            "quality": study.quality is not None,
            "tests": study.tests is not None,
            "baseline": study.baseline is not None,
            "cycles": study.cycles is not None,
            "area": study.area is not None,
            "power": study.power is not None,
        }

    def check(self, point: Point, manifest: Manifest) -> None:
        """Refuse frames that are too large for a configuration."""
        try:
            check_size(self.study.workload.size, manifest)
            if self.study.power is not None and self.study.power.size is not None:
                check_size(self.study.power.size, manifest)
        except UserError as error:
            raise self.file.error(("workload", "size"), f"{quoted(point.name)}: {error}") from None

    def references(self) -> dict[str, Job]:
        """Embree's frames, by the frame's name."""
        if self.study.quality is None:
            return {}
        size = self.study.workload.size
        return {
            frame.name: _job(
                "reference",
                f"reference of {frame.name}",
                {"frame": frame.identity, "size": size},
                {"scene": frame.scene, "mesh": frame.mesh, "size": size},
            )
            for frame in self.frames
        }

    def jobs(
        self, point: Point, manifest: Manifest, baseline: tuple[Point, Manifest] | None, is_checked: bool = False
    ) -> PointJobs:
        """All jobs of a point, with jobs of the baseline's pictures.

        Args:
            point: The point.
            manifest: Of its design.
            baseline: The point of the baseline, with its manifest.
            is_checked: If the cycle model counts the point's cycles, the RTL counts those of one frame, too.
        """
        study, found = self.study, PointJobs(point, manifest)
        design = {"config": self._config, "overrides": (*self._base, *point.overrides[self._prefix :])}
        if study.quality is not None:
            references = self.references()
            for frame in self.frames:
                own = found.pictures[frame.name] = self._picture(point, manifest, frame)
                others = {"reference": references[frame.name]}
                if baseline is not None:
                    others["baseline"] = self._picture(*baseline, frame)
                found.support += others.values()
                for to, other in others.items():
                    found.comparisons[frame.name, to] = _job(
                        "comparison",
                        f"comparison of {point.name} with {to}, {frame.name}",
                        {"dists": study.quality.dists},
                        {"with_dists": study.quality.dists},
                        inputs=(other.key, own.key),
                    )
        if study.tests is not None:
            found.pictures |= {frame.name: self._picture(point, manifest, frame) for frame in self.frames}
            if study.tests.same_pictures and baseline is not None and baseline[0].children == point.children:
                found.models = {frame.name: self._picture(*baseline, frame) for frame in self.frames}
                found.support += found.models.values()
        identity = {"config": manifest.config}
        if study.cycles is not None:
            found.is_modelled = study.cycles.backend == "model" and knows_design(manifest)
            for frame in self._frames_of(point, study.cycles.meshes):
                title = f"cycles of {point.name}, {frame.name}"
                timed = title, design, manifest, frame, study.workload.size
                found.cycles[frame.name] = counted_job(*timed) if found.is_modelled else cycles_job(*timed)
                if found.is_modelled and is_checked and study.cycles.check and not found.checks:
                    found.checks[frame.name] = cycles_job(f"RTL check of {title}", *timed[1:])
        for library in self.libraries:
            of_library = identity | {"library": self._digests.get(library, {})}
            arguments = design | {"library": self._contents.get(library, {})}
            area = _job("area", f"area of {point.name}, {library}", of_library, arguments)
            if study.area is not None:
                found.areas[library] = area
            if study.power is not None:
                for frame in self._frames_of(point, study.power.meshes):
                    run: dict[str, Any] = {
                        "size": study.power.size,
                        "window": study.power.cycles,
                        "clock": study.power.clock,
                    }
                    found.powers[library, frame.name] = _job(
                        "power",
                        f"power of {point.name}, {library}, {frame.name}",
                        of_library | {"frame": frame.identity} | run,
                        arguments | {"scene": frame.scene, "mesh": frame.mesh} | run,
                        after=(area.key,) if study.area is not None else (),
                    )
        return found

    def _picture(self, point: Point, manifest: Manifest, frame: Frame) -> Job:
        size, frame = self.study.workload.size, frame.with_children(point.children)
        overrides = (*self._base, *point.overrides[self._prefix :])
        facts = picture_facts(manifest) | {"frame": frame.identity, "size": size}
        arguments = {"config": self._config, "overrides": overrides, "scene": frame.scene, "mesh": frame.mesh}
        return _job("picture", f"picture of {point.name}, {frame.name}", facts, arguments | {"size": size})

    def _frames_of(self, point: Point, meshes: Sequence[str]) -> list[Frame]:
        frames = [frame for frame in self.frames if not meshes or frame.source in meshes]
        return [frame.with_children(point.children) for frame in frames]


class PointJobs:
    """The jobs of a point, and its entry in ``study.json``."""

    def __init__(self, point: Point, manifest: Manifest) -> None:
        self.point = point
        self.manifest = manifest
        self.pictures: dict[str, Job] = {}
        self.models: dict[str, Job] = {}
        self.comparisons: dict[tuple[str, str], Job] = {}
        self.cycles: dict[str, Job] = {}
        self.is_modelled = False
        self.checks: dict[str, Job] = {}
        self.areas: dict[str, Job] = {}
        self.powers: dict[tuple[str, str], Job] = {}
        self.support: list[Job] = []

    def all(self) -> list[Job]:
        """All jobs."""
        parts: Iterable[Iterable[Job]] = (
            self.support,
            *(part.values() for part in (self.pictures, self.comparisons, self.cycles, self.checks)),
            *(part.values() for part in (self.areas, self.powers)),
        )
        return [job for part in parts for job in part]

    def entry(self, plan: Plan, outcomes: Mapping[str, Outcome]) -> dict[str, Any]:
        """The point's entry. Jobs without an outcome yet, or that failed, leave None."""
        failures: list[dict[str, Any]] = []
        said: set[int] = set()

        def of(job: Job | None, workload: str | None = None, library: str | None = None) -> dict[str, Any] | None:
            outcome = outcomes.get(job.key) if job else None
            if isinstance(outcome, JobFailed) and job is not None and id(outcome) not in said:
                said.add(id(outcome))
                failure = {"measure": job.kind.name, "workload": workload, "library": library}
                failures.append(failure | {"reason": str(outcome)})
            return figures_of(outcome) if isinstance(outcome, Path) else None

        workloads: dict[str, Any] = {}
        for frame in plan.frames:
            values: dict[str, Any] = {}
            picture = of(self.pictures.get(frame.name), frame.name)
            values["error_bits"] = picture and picture["error_bits"]
            if plan.study.tests is not None:
                values |= {key: picture and picture[key] for key in ("counters", "records")}
                if self._differs(frame.name, outcomes):
                    reason = f"its picture differs from that of {plan.study.baseline}"
                    failures.append({"measure": "tests", "workload": frame.name, "library": None, "reason": reason})
            for to, suffix in (("reference", ""), ("baseline", "_baseline")):
                found = of(self.comparisons.get((frame.name, to)), frame.name) or {}
                values |= {f"{key}{suffix}": found.get(key) for key in ("psnr", "ssim", "flip", "dists")}
            timed = of(self.cycles.get(frame.name), frame.name) or {}
            keys = ("cycles", "rays_per_cycle_in_box", "bottleneck", "utilisation", "stalls")
            values |= {key: timed.get(key) for key in keys} | {"is_timed": frame.name in self.cycles}
            if self.is_modelled:
                check = of(self.checks.get(frame.name), frame.name) or {}
                values |= {"is_modelled": True, "rtl_cycles": check.get("cycles")}
            workloads[frame.name] = values
        reports = {name: of(job, None, name) for name, job in self.areas.items()}
        area = {name: figures.area_figures(report) for name, report in reports.items() if report}
        power: dict[str, dict[str, Any]] = {}
        for (library, frame_name), job in self.powers.items():
            run = of(job, frame_name, library)
            power.setdefault(library, {})[frame_name] = run and figures.power_figures(run)
            for name, unit in area.get(library, {}).get("units", {}).items():
                unit.setdefault("power_mw", run and run["units"].get(name))
        return {
            "name": self.point.name,
            "values": dict(self.point.values),
            "config": config_of(plan.file),
            "overrides": list(self.point.overrides),
            "config_hash": self.manifest.config_hash,
            "config_values": self.manifest.config,
            "workloads": workloads,
            "area": area,
            "power": power,
            "failures": failures,
        }

    def _differs(self, frame: str, outcomes: Mapping[str, Outcome]) -> bool:
        """Whether the picture of a frame and the one that it must equal are there and differ."""
        pair = (jobs[frame].key for jobs in (self.pictures, self.models) if frame in jobs)
        found = [outcome for key in pair if isinstance(outcome := outcomes.get(key), Path)]
        return len({(folder / PICTURE).read_bytes() for folder in found}) > 1


def picture_facts(manifest: Manifest) -> dict[str, Any]:
    """What of a design decides a picture, and the work of its frame: not the array."""
    sections = {key: value for key, value in manifest.config.items() if key not in _ARRAY_SECTIONS}
    facts: dict[str, Any] = {"formats": manifest.format_hash, "numbers": dict(manifest.numbers), "config": sections}
    return facts | {"stack": manifest.config["columnBvhMemory"]["stackDepth"]}


def _job(kind: str, title: str, identity: Mapping[str, Any], arguments: Mapping[str, Any], **links: Any) -> Job:
    return Job(KINDS[kind], title, identity, arguments, **links)


def _library(file: StudyFile, name: str, given: Mapping[str, Sequence[str]]) -> dict[str, bytes]:
    """The liberty files of a library by their names; a published library's if none are given."""
    if name not in given and name not in LIBRARIES:
        advice = f"--library {name}=FILE names its liberty files"
        raise file.error(("libraries", name), f"the library {name} has no files: {advice}")
    found: dict[str, bytes] = {}
    try:
        paths = library_files(given.get(name, (name,)))
    except UserError as error:
        raise file.error(("libraries", name), f"the library {name}: {error}") from None
    for path in paths:
        # Files of two folders may share a name
        own = path.name if path.name not in found else f"{len(found)}-{path.name}"
        found[own] = read_input(path, "the liberty", MAX_LIBERTY_BYTES)
    return found
