"""Checks the arguments of the API against their annotations: a wrong type is one line, not an error of some library."""

from __future__ import annotations

import functools
import inspect
import reprlib
import types
from collections.abc import Callable, Mapping, Sequence
from numbers import Integral, Real
from typing import Annotated, Any, Literal, ParamSpec, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

from colonnade.common.errors import UserError

P = ParamSpec("P")
R = TypeVar("R")

#: What fits an annotation besides its own values, and its words. Numbers may be numpy's; a Boolean is no number.
_PLAIN: Mapping[object, tuple[Any, str]] = {
    bool: (bool | np.bool_, "true or false"),
    int: (Integral, "a whole number"),
    float: (Real, "a number"),
    str: (str, "text"),
}


def checked(call: Callable[P, R]) -> Callable[P, R]:
    """The function, whose arguments are checked against its annotations before it runs.

    ``Annotated[hint, words]`` names what fits in messages. Annotations that are no classes and have no values to
    compare, such as protocols, fit everything.

    Raises:
        UserError: An argument is missing, unknown, or does not fit.
    """
    signature = inspect.signature(call)

    @functools.wraps(call)
    def with_check(*args: P.args, **kwargs: P.kwargs) -> R:
        try:
            given = signature.bind(*args, **kwargs).arguments
        except TypeError as error:
            raise UserError(f"{call.__qualname__}: {error}") from None
        check_types(given, call)
        return call(*args, **kwargs)

    return with_check


def check_types(values: Mapping[str, Any], owner: Callable[..., object]) -> None:
    """Check values by name against the annotations of a function's arguments, or of a class's fields.

    Raises:
        UserError: A value does not fit; the message has its name, the value, and what fits.
    """
    for name, hint in _hints(owner).items():
        if name in values and not _fits(values[name], hint):
            raise UserError(f"{name} is {reprlib.repr(values[name])}: it must be {_words(hint)}")


def is_whole(value: Any) -> bool:
    """Whether a value is a whole number, of Python or numpy."""
    return _fits(value, int)


@functools.cache
def _hints(owner: Callable[..., object]) -> dict[str, Any]:
    return get_type_hints(owner, include_extras=True)


def _fits(value: Any, hint: Any) -> bool:
    kind, inner = get_origin(hint) or hint, get_args(hint)
    if kind is Annotated:
        return _fits(value, inner[0])
    if kind in (Union, types.UnionType):
        return any(_fits(value, one) for one in inner)
    if kind is Literal:
        return isinstance(value, str) and value in inner
    if kind is Any:
        return True
    if kind in _PLAIN:
        return isinstance(value, _PLAIN[kind][0]) and (kind is bool or not isinstance(value, bool))
    if kind is tuple and ... not in inner:
        return isinstance(value, tuple | list) and len(value) == len(inner) and all(map(_fits, value, inner))
    if kind in (Sequence, tuple):
        is_list = isinstance(value, Sequence) and not isinstance(value, str | bytes)
        return is_list and all(_fits(one, inner[0]) for one in value)
    return not isinstance(kind, type) or getattr(kind, "_is_protocol", False) or isinstance(value, kind)


def _words(hint: Any) -> str:
    """What fits a hint, for messages."""
    kind, inner = get_origin(hint) or hint, get_args(hint)
    if kind is Annotated:
        return str(inner[1])
    if kind in (Union, types.UnionType):
        return ", or ".join(_words(one) for one in inner if one is not types.NoneType)
    if kind is Literal:
        return f"one of {', '.join(inner)}"
    if kind is tuple:
        return f"({', '.join(map(_words, inner))})"
    return _PLAIN[kind][1] if kind in _PLAIN else f"a {getattr(kind, '__name__', kind)}"
