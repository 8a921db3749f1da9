"""`tools/vocabulary` refuses new uses of replaced words, and lets their number only fall."""

from __future__ import annotations

import json
from importlib.machinery import SourceFileLoader
from importlib.util import module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType

import pytest

TOOL = Path(__file__).parents[3] / "tools" / "vocabulary"
SCALA = ".scala .hpp .cpp"


@pytest.fixture
def vocabulary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The tool with an empty table."""
    monkeypatch.syspath_prepend(str(TOOL.parent))
    loader = SourceFileLoader("vocabulary", str(TOOL))
    loader.cache_bytecode = lambda *_: None  # type: ignore[attr-defined]
    tool = module_from_spec(spec_from_loader("vocabulary", loader))  # type: ignore[arg-type]
    loader.exec_module(tool)
    monkeypatch.setattr(tool, "LEFT", tmp_path / "left.json")
    tool.LEFT.write_text("{}")
    return tool


def run(tool: ModuleType, monkeypatch: pytest.MonkeyPatch, texts: dict[str, str], lower: bool = False) -> int:
    monkeypatch.setattr(tool, "sources", lambda: texts)
    return int(tool.main(lower))


@pytest.mark.parametrize(
    "texts",
    [
        {"docs/unit.md": "It takes a wish."},
        {"src/Unit.scala": "/** It is the eldest entry. */\n"},
        {"src/Unit.scala": "val asked = 1\n"},
        {"host/unit.py": "most = 1\n"},
        {"host/unit.hpp": "int asked;\n"},
    ],
)
def test_a_new_use_is_refused(
    vocabulary: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], texts: dict[str, str]
) -> None:
    assert run(vocabulary, monkeypatch, texts) == 1
    assert "1 uses of" in (error := capsys.readouterr().err) and f"{next(iter(texts))}:1" in error


@pytest.mark.parametrize(
    "text", ["a render unit", "mW of a render\n    unit", "/** A render\n  * unit. */", "render_unit"]
)
def test_a_phrase_is_of_its_pages(
    vocabulary: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], text: str
) -> None:
    assert run(vocabulary, monkeypatch, {"docs/glossary.md": text}) == 0
    assert run(vocabulary, monkeypatch, {"docs/unit.md": text}) == 1
    assert "docs/unit.md says 'render" in capsys.readouterr().err


def test_sentences_may_use_english_words(vocabulary: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    texts = {"docs/unit.md": "It is asked.", "src/Unit.scala": '// It is asked.\nval text = "asked"\n'}
    assert run(vocabulary, monkeypatch, texts) == 0


def test_uses_may_only_fall(vocabulary: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    one, two = {"src/Unit.scala": "val asked = 1\n"}, {"src/Unit.scala": "val asked = 1 + asked\n"}
    vocabulary.LEFT.write_text(json.dumps({SCALA: {"asked": 2}}))
    assert run(vocabulary, monkeypatch, two) == 0
    assert run(vocabulary, monkeypatch, one) == 1
    assert run(vocabulary, monkeypatch, one, lower=True) == 0
    assert run(vocabulary, monkeypatch, one) == 0
    assert run(vocabulary, monkeypatch, two) == 1
    assert run(vocabulary, monkeypatch, two, lower=True) == 1
    assert json.loads(vocabulary.LEFT.read_text())[SCALA] == {"asked": 1}
