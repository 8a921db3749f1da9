"""What a data file keeps of a report: what a table, a plot or the browser tab reads, a record on a line."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any

#: Keys of reports that no page shows, or that the data file has itself.
_LEFT_OUT = frozenset({"cells", "flop_tables", "picture", "config", "config_hash", "command", "commit", "is_modified"})

#: What is read of a study, of its points, of their frames and areas, and of the frames' counters.
_STUDY = ("version", "title", "axes", "columns", "libraries", "workloads", "baseline", "points", "render_index")
_POINT = ("name", "values", "overrides", "config_values", "workloads", "area", "figures", "on_front")
_FRAME = ("dists_baseline", "cycles", "rays_per_cycle_in_box", "counters", "records")
_AREA = ("traversal_unit_kge", "array_kge")
_COUNTERS = ("raysInBox", "boxTests", "triangleTests")

#: The characters of a line that holds a whole record.
WIDTH = 1200


def kept(report: Any) -> Any:
    """A report without what is left out."""
    if isinstance(report, Mapping):
        if "points" in report and "workloads" in report:
            report = _of_study(report)
        return {key: kept(value) for key, value in report.items() if key not in _LEFT_OUT}
    return [kept(value) for value in report] if isinstance(report, list) else report


def record_lines(value: Any, indent: str = "") -> str:
    """JSON text in which a value of at most `WIDTH` characters is one line."""
    text = json.dumps(value, allow_nan=False)
    if len(indent) + len(text) <= WIDTH or not value or not isinstance(value, (Mapping, list)):
        return text
    inner = f"{indent}  "
    if isinstance(value, Mapping):
        items = [f"{json.dumps(key)}: {record_lines(each, inner)}" for key, each in value.items()]
    else:
        items = [record_lines(each, inner) for each in value]
    first, last = "{}" if isinstance(value, Mapping) else "[]"
    return f"{first}\n" + ",\n".join(inner + item for item in items) + f"\n{indent}{last}"


def _of_study(study: Mapping[str, Any]) -> dict[str, Any]:
    found = _chosen(study, _STUDY)
    if "render_index" in found:
        found["render_index"] = {"rows": [_chosen(row, ("name", "index")) for row in found["render_index"]["rows"]]}
    return found | {"points": [_of_point(point) for point in study["points"]]}


def _of_point(point: Mapping[str, Any]) -> dict[str, Any]:
    frames = {name: _chosen(frame, _FRAME) for name, frame in point["workloads"].items()}
    for frame in frames.values():
        if "counters" in frame:
            frame["counters"] = _chosen(frame["counters"], _COUNTERS)
    areas = {library: _chosen(area, _AREA) for library, area in point["area"].items()}
    return _chosen(point, _POINT) | {"workloads": frames, "area": areas}


def _chosen(values: Mapping[str, Any], keys: Iterable[str]) -> dict[str, Any]:
    """The values of keys, without unmeasured ones."""
    return {key: values[key] for key in keys if values.get(key) is not None}
