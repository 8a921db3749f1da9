"""Record layouts and registers: packing and unpacking are inverse."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colonnade.common.errors import UserError
from colonnade.design.manifest import Field, Manifest, RecordLayout, Register, value_range


@st.composite
def layouts(draw: st.DrawFn) -> RecordLayout:
    """A random record layout with gaps, fields in any order."""
    fields, offset = {}, draw(st.integers(0, 40))
    for i in range(draw(st.integers(1, 12))):
        width = draw(st.integers(1, 62))
        fields[f"f{i}"] = Field(f"f{i}", offset, width, draw(st.booleans()), 0)
        offset += width + draw(st.integers(0, 5))
    return RecordLayout("record", -(-offset // 32) * 32, fields)


@given(layouts(), st.data())
def test_a_record_unpacks_to_what_was_packed(layout: RecordLayout, data: st.DataObject) -> None:
    count = data.draw(st.integers(1, 4))
    values = {
        name: data.draw(st.lists(st.integers(*field.range), min_size=count, max_size=count))
        for name, field in layout.fields.items()
    }
    records = layout.pack(values)
    assert records.shape == (count, layout.bits // 8)
    assert {name: column.tolist() for name, column in layout.unpack(records).items()} == values
    for row, record in enumerate(records):
        bits = int.from_bytes(record.tobytes(), "little")
        for name, field in layout.fields.items():
            assert (bits >> field.offset) & ((1 << field.width) - 1) == values[name][row] & ((1 << field.width) - 1)


def test_a_value_that_does_not_fit_is_refused() -> None:
    layout = RecordLayout("record", 32, {"a": Field("a", 0, 4, False, 0)})
    with pytest.raises(ValueError, match="does not fit 4 bits"):
        layout.pack({"a": np.array([16])})
    with pytest.raises(ValueError, match="no field b"):
        layout.pack({"b": np.array([0])})


@given(st.integers(1, 100), st.booleans(), st.data())
def test_a_register_decodes_to_what_was_encoded(width: int, signed: bool, data: st.DataObject) -> None:
    value = data.draw(st.integers(*value_range(width, signed)))
    register = Register("r", 7, -(-width // 32), width, signed, "rw")
    writes = register.encode(value)
    assert [address for address, _ in writes] == list(range(7, 7 + register.words))
    assert register.decode([word for _, word in writes]) == value


def test_a_manifest_is_read_from_its_file(tmp_path: Path, manifest: Manifest, manifest_json: dict[str, Any]) -> None:
    (tmp_path / "manifest.json").write_text(json.dumps(manifest_json))
    assert Manifest.load(tmp_path) == manifest


def test_a_design_of_any_version_tells_whether_it_has_queries(manifest_json: dict[str, Any]) -> None:
    config = manifest_json["config"]
    older = {"frame": config["frame"] | {"rays": True}}
    for settings, expected in (({"queries": None}, False), ({"queries": {"contexts": 64}}, True), (older, True)):
        assert Manifest.from_dict(manifest_json | {"config": config | settings}).has_queries is expected


@pytest.mark.parametrize("text", ["", "{", "[]", '{"version": 1}'])
def test_an_invalid_manifest_is_one_line(tmp_path: Path, text: str) -> None:
    file = tmp_path / "manifest.json"
    file.write_text(text)
    with pytest.raises(UserError, match="generate"):
        Manifest.load(file)
    with pytest.raises(UserError, match="colonnade generate"):
        Manifest.load(tmp_path / "missing.json")
