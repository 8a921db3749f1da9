"""tools/site points the links of every page at the site's pages, and refuses links that lead nowhere."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]


def stage(folder: Path, ending: str) -> tuple[int, str, str]:
    """Stage a checkout whose page docs/gather.md has another ``ending``: status, errors, the end of the page."""
    checkout = folder / "checkout"
    for parent in ("tools", "docs"):
        (checkout / parent).mkdir(parents=True)
        for path in (ROOT / parent).iterdir():
            (checkout / parent / path.name).symlink_to(path)
    for path in ROOT.iterdir():
        if path.name not in ("tools", "docs"):
            (checkout / path.name).symlink_to(path)
    (checkout / "tools" / "site").unlink()
    shutil.copytree(ROOT / "tools" / "site", checkout / "tools" / "site")
    page = checkout / "docs" / "gather.md"
    text = page.read_text(encoding="utf-8")
    page.unlink()
    page.write_text(f"{text}\nThe ending.\n{ending}\n", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, checkout / "tools" / "site" / "stage.py", folder / "site"], capture_output=True, text=True
    )
    staged = (folder / "site" / "docs" / "gather.md").read_text(encoding="utf-8")
    return done.returncode, done.stderr.strip(), staged.rpartition("The ending.\n")[2].rstrip("\n")


#: Links as they are written and as they are staged
LINKS = (
    ("a ([sec\nurity](../SECURITY.md#scope)).", "a ([sec\nurity](security.md#scope))."),
    ("[shading](\n  shading.md)", "[shading](shading.md)"),
    ('[log](../CHANGELOG.md "what\nis new")', '[log](changelog.md "what\nis new")'),
    ("[log](<../CHANGELOG.md>)", "[log](changelog.md)"),
    ("[`a[0]` of [b]](../README.md)", "[`a[0]` of [b]](index.md)"),
    ("[![room](pictures/room.png)](../README.md)", "[![room](pictures/room.png)](index.md)"),
    ("[Config\nfields](../build.sbt)", "Config\nfields"),
    (
        "`[x](../SECURITY.md)`, [0, 1) and [log](../CHANGELOG.md)",
        "`[x](../SECURITY.md)`, [0, 1) and [log](changelog.md)",
    ),
    ("```\n[x](nowhere.md)\n```", "```\n[x](nowhere.md)\n```"),
    ("[a\n\nb](nowhere.md)", "[a\n\nb](nowhere.md)"),
    ("[faults](../src/test/mutations.toml)", "[faults](modules.md)"),
)


def test_links_lead_to_the_pages_of_the_site(tmp_path: Path) -> None:
    written, staged = ("\n\n".join(each) for each in zip(*LINKS, strict=True))
    assert stage(tmp_path, written) == (0, "", staged)
    assert "`RowBufferSpec`" in (tmp_path / "site" / "docs" / "modules.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("written", "error"),
    [
        ("[no\nwhere](nowhere.md)", "docs/gather.md links to nowhere.md, which does not exist"),
        ("[![b](nowhere.png)](shading.md)", "docs/gather.md links to nowhere.png, which does not exist"),
        (
            "[log][l]\n\n[l]: ../CHANGELOG.md",
            "docs/gather.md has a link that is not written inline, [text](address): [l]: ../CHANGELOG.md",
        ),
        (
            '<img src="x.png">',
            'docs/gather.md has a link that is not written inline, [text](address): <img src="x.png">',
        ),
    ],
)
def test_a_link_that_the_site_would_not_have_is_refused(written: str, error: str, tmp_path: Path) -> None:
    status, errors, _ = stage(tmp_path, written)
    assert (status, errors) == (1, error)
