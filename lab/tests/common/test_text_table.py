"""Text tables are aligned, and parallel results come in order."""

from __future__ import annotations

import threading

import pytest
from colonnade.common.errors import UserError

from colonnade_lab.common.parallel import in_order
from colonnade_lab.common.text_table import Column, Table


def test_columns_are_aligned_with_titles_and_groups() -> None:
    lines: list[str] = []
    table = Table(
        (
            Column("mesh", 6, is_text=True),
            Column("cycles", 7, ","),
            Column("in box", 5, ".2f", group="rays"),
            Column("all", 5, ".2f", group="rays"),
        ),
        lines.append,
    )
    assert not lines, "no heading without a row"
    table.print("cube", 1234, 0.5, None)
    table.print("torus", 5, 12.0, 0.125)
    assert lines == [
        "                 rays",
        "mesh     cycles  in box    all",
        "cube      1,234    0.50      -",
        "torus         5   12.00   0.12",
    ]


def test_results_come_in_order() -> None:
    second = threading.Event()

    def work(item: int) -> int:
        if item == 0:
            second.wait()  # it runs beside the first
        else:
            second.set()
        return item * item

    assert list(in_order(work, [0, 1, 2], 2)) == [0, 1, 4]
    assert list(in_order(work, [], 2)) == []


def test_the_longest_task_starts_first() -> None:
    begun: list[int] = []
    assert list(in_order(lambda item: begun.append(item) or item, [1, 7, 3, 7, 5], 1, length=float)) == [1, 7, 3, 7, 5]
    assert begun == [7, 7, 5, 3, 1]


def test_no_task_starts_after_a_failure() -> None:
    begun: list[int] = []

    def work(item: int) -> None:
        begun.append(item)
        raise UserError("wrong")

    with pytest.raises(UserError):
        list(in_order(work, list(range(100)), 1))
    assert len(begun) < 100
