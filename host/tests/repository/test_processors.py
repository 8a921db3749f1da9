"""Words of the device do not depend on the processor or on the number of threads (colonnade.common.fixed_order)."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
SOURCES = HERE.parents[1] / "colonnade"
#: What decides words: files and folders.
DECIDING = (
    "common/srgb.py", "common/vectors.py", "maps", "environment/light_fit.py", "environment/lights.py",
    "environment/photo_colours.py", "environment/repair.py", "environment/depth_normals.py",
    "environment/derived_albedo.py", "environment/seen_sources.py", "mesh", "scene/joined_mesh.py",
    "scene/object_pose.py", "scene_image",
)  # fmt: skip
#: Reports, which decide nothing.
REPORTS = {"quality.py", "visualise.py"}
#: Functions of numpy whose order or rounding the processor chooses.
BY_PROCESSOR = {
    "arccos", "arcsin", "arctan", "arctan2", "cbrt", "cos", "cosh", "dot", "einsum", "exp", "exp2", "expm1", "hypot",
    "inner", "log", "log10", "log1p", "log2", "matmul", "power", "sin", "sinh", "tan", "tanh", "tensordot", "vdot",
}  # fmt: skip
#: A processor without AVX, with other kernels of linear algebra and two threads.
OTHER = {
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4",
    "OPENBLAS_CORETYPE": "Prescott",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4",
    "OMP_NUM_THREADS": "2",
    "OPENBLAS_NUM_THREADS": "2",
}


def words(changes: dict[str, str]) -> str:
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "PYTHONPATH": str(HERE.parent), **changes}
    return subprocess.run(
        [sys.executable, HERE / "device_words.py"], env=environment, capture_output=True, text=True, check=True
    ).stdout


def test_words_are_the_same_on_every_processor() -> None:
    assert words(OTHER) == words({})


def test_what_decides_words_uses_arithmetic_in_a_fixed_order() -> None:
    """Processors that are not at hand, as those with AVX-512, have kernels of their own in the same functions."""
    places = [SOURCES / name for name in DECIDING]
    files = [file for place in places for file in ([place] if place.is_file() else place.rglob("*.py"))]
    found = [
        f"{file.relative_to(SOURCES)}:{node.lineno}: {ast.unparse(node)}"
        for file in sorted(files)
        if file.name not in REPORTS
        for node in ast.walk(ast.parse(file.read_text()))
        if _is_by_processor(node)
    ]
    assert len(files) > 50 and found == []


def _is_by_processor(node: ast.AST) -> bool:
    if isinstance(node, ast.BinOp):
        is_root = isinstance(node.right, ast.Constant) and not isinstance(node.right.value, int)
        return isinstance(node.op, ast.MatMult) or (isinstance(node.op, ast.Pow) and is_root)
    if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
        return False
    owner, name = ast.unparse(node.func.value), node.func.attr
    if owner == "np.linalg":  # norm along an axis is a sum of products and a root
        return name != "norm" or not any(keyword.arg == "axis" for keyword in node.keywords)
    return owner == "np" and name in BY_PROCESSOR
