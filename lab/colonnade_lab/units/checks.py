"""Checks of Chisel as Yosys reads them: firtool writes `assert` as `$error` and `$fatal`, which Yosys does not know."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

_STRING = r'"(?:[^"\\]|\\.)*"'
_COMMENT = re.compile(rf"({_STRING})|\s*//[^\n]*")
_ASSERTION = re.compile(
    rf"if \(`ASSERT_VERBOSE_COND_\)\s*\$error\(\s*({_STRING})[^;]*;\s*if \(`STOP_COND_\)\s*\$fatal;"
)
_PRINT = re.compile(rf"\$fwrite\(\s*32'h80000002,\s*{_STRING}[^;]*;")
# Of some assertions firtool writes both forms
_NATIVE = re.compile(r"assert__\w+:\s*assert\((?:.|\n)*?\);.*?//.*?(\w+\.scala:\d+).*")
_COVER = re.compile(r"cover__\w+:\s*cover\(((?:.|\n)*?)\);(.*)")
_KEPT = "colonnade_kept"


@dataclass(frozen=True)
class Checks:
    """A proof as Yosys reads it.

    Attributes:
        verilog: The modules, each assertion labelled `assertion_N`, each cover the assertion `cover_N` of its contrary.
        texts: Text and place of each label.
    """

    verilog: str
    texts: Mapping[str, str]

    @property
    def covers(self) -> list[str]:
        """Labels of the covers."""
        return [label for label in self.texts if label.startswith("cover_")]


def read_checks(verilog: str, top: str, cycles: int) -> Checks:
    """The checks of a module and those below it.

    Args:
        verilog: What firtool writes.
        top: The outermost module. It has a clock and a reset.
        cycles: One more cover happens in this cycle after the reset: the assumptions can be kept until then.

    Raises:
        ValueError: The text has a check that firtool did not write when this was made.
    """
    texts: dict[str, str] = {}

    def assertion(match: re.Match[str]) -> str:
        text, place = (re.search(pattern, match[1]) for pattern in (r": (.*?)\\n", r"at (\S+:\d+)"))
        label = f"assertion_{len(texts)}"
        texts[label] = f"{repr(text[1]) if text else 'an assertion'} ({place[1] if place else top})"
        return f"{label}: assert(1'b0);"

    def cover(match: re.Match[str]) -> str:
        label = f"cover_{len(texts)}"
        # The comment has the places of all parts, the cover's last: "// A.scala:3:5, :9:{2,7}"
        lines = re.findall(r":(\d+):", match[2])
        file = re.search(r".*[ \t](\S+?\.scala):", match[2])
        texts[label] = f"{file[1]}:{lines[-1]}" if file and lines else top
        return f"{label}: assert(!({match[1]}));{match[2]}"

    twice = _NATIVE.sub(lambda match: ";" if f"at {match[1]} " in verilog else match[0], verilog)
    plain = _COMMENT.sub(lambda match: match[1] or "", _COVER.sub(cover, twice))
    verilog = _PRINT.sub(";", _ASSERTION.sub(assertion, plain))
    left = re.search(r"\$(?:error|fatal|fwrite)\b|\b(?:assert|cover)__\w*", verilog)
    if left:
        raise ValueError(f"firtool wrote {left[0]}, a check that is not known")
    # The last module is the top one
    bits = cycles.bit_length()
    kept = f"""
  reg [{bits - 1}:0] {_KEPT};
  always @(posedge clock) begin
    if (reset) {_KEPT} <= 1;
    else if ({_KEPT} != {cycles}) {_KEPT} <= {_KEPT} + 1;
    if (!reset) cover_kept: assert({_KEPT} != {cycles});
  end
endmodule"""
    head, _, tail = verilog.rpartition("endmodule")
    return Checks(head + kept + tail, texts | {"cover_kept": f"the assumptions cannot be kept for {cycles} cycles"})
