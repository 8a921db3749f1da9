"""Norms of the RenderIndex: arithmetic, and nothing else; the message names what is wrong."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from colonnade.common.errors import UserError

from colonnade_lab.explore.norm import Norm
from colonnade_lab.explore.render_index import Norms, index_rows
from colonnade_lab.explore.study_file import load_study

STUDY = 'title = "t"\n[axes]\n"array.rows" = [1]\n[workload]\nscenes = ["a.toml"]\n[area]\n[render_index]\n'


@pytest.mark.parametrize(
    ("text", "x", "value"),
    [
        ("1 + x / 0.1", 0.5, 6.0),
        ("x", 3.0, 3.0),
        ("-x ** 2 + +1", 2.0, -3.0),
        ("max(1, sqrt(x), log(exp(abs(x))))", 9.0, 9.0),
        ("2", 0.0, 2.0),
    ],
)
def test_a_norm_is_arithmetic(text: str, x: float, value: float) -> None:
    assert Norm(text)(x) == pytest.approx(value)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("1 + y", "has 'y'"),
        ("x // 2", "has 'x // 2'"),
        ("open('f')", r"has \"open\('f'\)\""),
        ("x.real", "has 'x.real'"),
        ("[x][0]", r"has '\[x\]\[0\]'"),
        ("True", "has 'True'"),
        ("1j", "has '1j'"),
        ("max()", r"has 'max\(\)'"),
        ("max(x, key=abs)", "has 'max"),
        ("lambda: x", "has 'lambda: x'"),
        ("1 +", "is no expression"),
        ("", "is no expression"),
        ("x = 1", "is no expression"),
        ("x" * 101, "101 characters"),
    ],
)
def test_anything_else_is_named(text: str, named: str) -> None:
    with pytest.raises(ValueError, match=named) as caught:
        Norm(text)
    assert "\n" not in str(caught.value)


def test_a_number_without_a_value_is_none() -> None:
    for text in ("1 / x", "log(x)", "x ** -1", "sqrt(x - 1)", "9 ** 9 ** 9 ** 9", "sqrt(1, 2)", "1e999"):
        assert math.isnan(Norm(text)(0.0)), text


def test_a_study_has_norms_of_its_own(tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    file.write_text(STUDY + 'loss = "1 + x / 0.1"\narea = "sqrt(x)"\n')
    norms = load_study(file).study.render_index.norms
    figures = {"dists": 0.1, "nj_28nm.a": 1.0, "mw.a": 1.0}
    points = [
        {"name": "base", "figures": figures | {"dists_loss": 0.0, "nj.a": 2.0, "array_kge.a": 9.0}},
        {"name": "lean", "figures": figures | {"dists_loss": 0.5, "nj.a": 1.0, "array_kge.a": 4.0}},
    ]
    lean = index_rows(points, "base", ["a"], norms)[1]
    assert lean["norm_loss"] == pytest.approx(6.0) and lean["index"] == pytest.approx(6.0 * 0.5 * 2 / 3)
    assert "(1 + x / 0.1) of DISTS loss" in norms.definition
    without = index_rows(points, "base", ["a"], Norms(loss=Norm("1 / (0.5 - x)")))[1]
    assert without["norm_loss"] is without["index"] is None


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ('loss = "1 + y"', r"study\.toml:8: render_index\.loss: the norm '1 \+ y' has 'y': it may have x, numbers, \+"),
        ('loss = "x"', r"study\.toml:8: render_index\.loss: the norm 'x' has no value above 0 for the baseline, x = 0"),
        ('power = "x - 1"', r"render_index\.power: the norm 'x - 1' has no value above 0 for the baseline, x = 1"),
        ("loss = 3", r"render_index\.loss: must be text in quotes, not 3"),
        ('los = "x"', r"unknown key render_index\.los; known here: loss, power, area"),
    ],
)
def test_mistakes_have_their_line(tmp_path: Path, line: str, message: str) -> None:
    file = tmp_path / "study.toml"
    file.write_text(STUDY + line + "\n")
    with pytest.raises(UserError, match=message):
        load_study(file)
