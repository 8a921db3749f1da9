"""Arguments are checked against annotations: numpy's numbers fit, Booleans are no numbers, and errors are one line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import numpy as np
import pytest
from numpy.typing import NDArray

from colonnade.common.arguments import checked
from colonnade.common.errors import UserError


class Closes(Protocol):
    def close(self) -> None: ...


@checked
def call(
    whole: int = 0,
    number: float = 0.0,
    is_set: bool = False,
    text: str | Path | None = None,
    pair: tuple[int, float] = (1, 2.0),
    many: tuple[int, ...] = (),
    names: Annotated[Sequence[str], "a list of names"] = (),
    kind: bool | Literal["a", "b"] = "a",
    table: Mapping[str, Any] | None = None,
    array: NDArray[np.uint8] | None = None,
    closes: Closes | None = None,
    **others: Any,
) -> object:
    return whole, others


@pytest.mark.parametrize(
    "values",
    [
        {"whole": np.int64(3), "number": 3, "is_set": np.bool_(True), "text": Path("a")},
        {"number": np.float32(1.5), "pair": [np.int8(1), 2], "many": (1, 2), "names": ["a"], "kind": False},
        {"table": {1: 2}, "array": np.zeros(2), "closes": 3, "other": 4},
    ],
)
def test_what_fits_is_passed_on(values: dict[str, Any]) -> None:
    expected = {name: value for name, value in values.items() if name == "other"}
    assert call(**values) == (values.get("whole", 0), expected)


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"whole": 2.0}, "whole is 2.0: it must be a whole number"),
        ({"whole": True}, "whole is True: it must be a whole number"),
        ({"whole": None}, "whole is None: it must be a whole number"),
        ({"number": "1"}, "number is '1': it must be a number"),
        ({"number": 1j}, "number is 1j: it must be a number"),
        ({"is_set": "no"}, "is_set is 'no': it must be true or false"),
        ({"is_set": 1}, "is_set is 1: it must be true or false"),
        ({"text": b"a"}, "text is b'a': it must be text, or a Path"),
        ({"pair": (1,)}, "pair is (1,): it must be (a whole number, a number)"),
        ({"names": "abc"}, "names is 'abc': it must be a list of names"),
        ({"names": ["a", 3]}, "names is ['a', 3]: it must be a list of names"),
        ({"kind": "c"}, "kind is 'c': it must be true or false, or one of a, b"),
        ({"kind": np.array([1, 2])}, "kind is array([1, 2]): it must be true or false, or one of a, b"),
        ({"table": [1]}, "table is [1]: it must be a Mapping"),
        ({"array": [1]}, "array is [1]: it must be a ndarray"),
    ],
)
def test_what_does_not_fit_is_named(values: dict[str, Any], says: str) -> None:
    with pytest.raises(UserError) as raised:
        call(**values)
    assert str(raised.value) == says


def test_a_wrong_signature_is_named() -> None:
    @checked
    def two(first: int, second: int) -> int:
        return first + second

    assert two(1, second=2) == 3
    with pytest.raises(UserError, match="two: missing a required argument: 'second'"):
        two(1)  # type: ignore[call-arg]
