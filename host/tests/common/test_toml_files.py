"""TOML of untrusted files: the depth of keys is limited before the parser sees them; texts and comments are no keys."""

from __future__ import annotations

import pytest

from colonnade.common.errors import UserError
from colonnade.common.limits import MAX_DEPTH
from colonnade.common.toml_files import parse_toml

#: Too many parts for the parser, whose time grows with their square.
PARTS = 300_000
DOTS = "a." * 100
NUMBERS = f"[{', '.join(['1.5'] * 100)}]"


@pytest.mark.parametrize(
    "text",
    [
        pytest.param("a." * PARTS + "b = 1", id="key"),
        pytest.param(f"[{'a . ' * PARTS}b]", id="header"),
        pytest.param(f"[[{'a.' * PARTS}b]]", id="tables"),
        pytest.param("x = {" + "a." * PARTS + "b = 1}", id="inline"),
        pytest.param('"a".' * PARTS + "b = 1", id="quoted"),
        pytest.param(r'"\"".' * PARTS + "b = 1", id="escaped"),
        pytest.param("'\"=#'.'[,'." * PARTS + "b = 1", id="separators"),
        pytest.param('x = ["""a\\""" \n#""""", {' + "a." * PARTS + "b = 1}]", id="after a text"),
        pytest.param("x = ['''\\'''', {" + "a." * PARTS + "b = 1}]", id="after a literal"),
        pytest.param("# it's\n" + "a." * PARTS + "b = 1", id="after a comment"),
    ],
)
def test_a_key_of_too_many_parts_is_refused(text: str) -> None:
    with pytest.raises(UserError, match="the scene is nested too deeply: 64 levels at most"):
        parse_toml(text.encode(), "the scene")


@pytest.mark.parametrize(
    "text",
    [
        pytest.param(f"x = {NUMBERS}\ny = {NUMBERS}", id="numbers"),
        pytest.param(f"# {DOTS}\nx = 1 # {DOTS}", id="comments"),
        pytest.param(f'x = "{DOTS}\\"{DOTS}"\ny = \'{DOTS}\\\'', id="texts"),
        pytest.param(f'x = """\n{DOTS}"{DOTS}\\"""{DOTS}"""\ny = 1.5', id="long text"),
        pytest.param(f"x = '''\n{DOTS}'{DOTS}'''\ny = 1.5", id="long literal"),
        pytest.param(f"{'.'.join(['a'] * (MAX_DEPTH - 1))} = 1.5", id="deepest"),
    ],
)
def test_dots_elsewhere_are_no_levels(text: str) -> None:
    assert parse_toml(b"\xef\xbb\xbf" + text.encode(), "the scene")
