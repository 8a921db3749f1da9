"""Writes the sources of the site into a folder, from which Zensical builds it: pages, pictures and the configuration.

- README, CHANGELOG, CONTRIBUTING and SECURITY become pages, so that each text exists once.
- tools/mutations makes the page of modules and faults; links to src/test/mutations.toml lead there.
- Each Python package of host/colonnade gets a page of its docstrings; the Python API's follow docs/api.md.
- Scaladoc, PeakRDL's register pages and the page of tools/browser are copied into the site, from the folders that the
  environment variables COLONNADE_SCALADOC, COLONNADE_REGISTERS and COLONNADE_BROWSER name.
- Links are written for the repository (``../SECURITY.md``); here they are pointed at the site's pages. Of a link to a
  source file only the text stays. A link to a file that the repository lacks, a link that is not written inline, and a
  page that the navigation lacks are errors. Zensical reports links to anchors that do not exist.
- GitHub's Markdown needs no blank line before a list or a table; Python-Markdown does.

usage: stage.py FOLDER
"""

from __future__ import annotations

import os
import posixpath
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PACKAGES = (ROOT / "host" / "colonnade", ROOT / "lab" / "colonnade_lab")

#: The table of mutations, whose page tools/mutations makes.
_MUTATIONS = "src/test/mutations.toml"
# Files outside docs and the pages that they become.
_OTHER_PAGES = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
    _MUTATIONS: "modules.md",
}
#: Folders of finished pages: environment variable, place, section, title.
_COPIED = (
    ("COLONNADE_SCALADOC", "scala", "Hardware by stage", "Scaladoc"),
    ("COLONNADE_REGISTERS", "registers", "Integration", "Register pages"),
    ("COLONNADE_BROWSER", "browser", "Host", "Browser tab"),
)
#: The pages that docstrings follow, and the modules.
_REFERENCES = {"api.md": ("colonnade.api.scene", "colonnade.device.device", "colonnade.device.shell_device")}
#: Pages of many words that explain little. They are not searched, so that the search finds the guides.
_UNSEARCHED = ("api/", "changelog.md")
#: An inline link or picture, whose parts may be on several lines of a paragraph; or code, in which there are none.
_LINK = re.compile(
    r"""
      ^[ ]*(?P<fence>```|~~~).*?^[ ]*(?P=fence)
    | (?P<ticks>`+)(?!`)(?:(?!\n[ ]*\n).)+?(?<!`)(?P=ticks)(?!`)
    | (?P<picture>!?)\[(?P<text>(?:`[^`]*`|!?\[[^\[\]]*\](?:\([^()]*\))?|[^\[\]`\n]|\n(?![ ]*\n))*)\]
      \(\s*<?(?P<address>[^()<>\s]+)>?(?P<title>\s+"[^"]*"|\s+'[^']*')?\s*\)
    """,
    re.MULTILINE | re.DOTALL | re.VERBOSE,
)
#: Links in other forms that GitHub renders: a definition of a reference, and HTML.
_OTHER_LINK = re.compile(
    r"^ {0,3}\[[^\]\n]+\]:\s*\S+|<(?:a|img|source)\s[^>]*\b(?:href|src|srcset)\b[^>]*>", re.MULTILINE
)
_FENCE = re.compile(r"^\s*(```|~~~)")
_ITEM = re.compile(r"^([-*+]|\d+\.) ")
_ROW = re.compile(r"^\|.*\|\s*$")


class Stage:
    """The sources of the site. ``errors`` are lines about links and pages."""

    def __init__(self) -> None:
        self.errors: list[str] = []
        #: Page of the site, and its file in the repository
        self.sources = {page: source for source, page in _OTHER_PAGES.items()}
        for path in sorted(DOCS.rglob("*.md")):
            page = path.relative_to(DOCS).as_posix()
            self.sources[page] = f"docs/{page}"

    def write(self, folder: Path) -> None:
        """Replace ``folder`` by the sources: ``docs`` and ``mkdocs.yml``."""
        shutil.rmtree(folder, ignore_errors=True)
        docs = folder / "docs"
        shutil.copytree(DOCS, docs, ignore=shutil.ignore_patterns("*.md", "*.toml", "*.json", "*.dot", "data"))
        for page, source in self.sources.items():
            path = docs / page
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(_front_matter(page) + self._page(page, source, docs), encoding="utf-8")
        (docs / "api").mkdir()
        for name in packages():
            page = f"api/{name}.md"
            (docs / page).write_text(f"{_front_matter(page)}# {name}\n\n::: {name}\n", encoding="utf-8")
        for variable, place, _, _ in _COPIED:
            if variable in os.environ:
                ignored = shutil.ignore_patterns(".*", "launcher*")
                shutil.copytree(os.environ[variable], docs / place, ignore=ignored)
        (folder / "mkdocs.yml").write_text(self._configuration(), encoding="utf-8")

    def _page(self, page: str, source: str, docs: Path) -> str:
        """A page's text with the site's links, and blank lines between paragraphs and what follows them."""
        lines: list[str] = []
        is_code = False
        for line in self._links(self._source(source), page, source, docs).split("\n"):
            if _FENCE.match(line):
                is_code = not is_code
            elif not is_code and lines and lines[-1].strip() and _begins_block(line, lines[-1]):
                lines.append("")
            lines.append(line)
        return "\n".join([*lines, *(f"\n::: {module}\n" for module in _REFERENCES.get(page, ()))])

    def _source(self, source: str) -> str:
        """The Markdown of the repository's file ``source``."""
        if source != _MUTATIONS:
            return (ROOT / source).read_text(encoding="utf-8")
        made = subprocess.run([sys.executable, ROOT / "tools/mutations", "--page"], capture_output=True, text=True)
        if made.returncode:
            self.errors.append(made.stderr.strip())
        return made.stdout

    def _links(self, text: str, page: str, source: str, docs: Path) -> str:
        """The ``text`` of the repository's file ``source`` with the links of the site's ``page``."""

        def replaced(found: re.Match[str]) -> str:
            return self._link(found, page, source, docs) if found["address"] else found[0]

        for other in _OTHER_LINK.findall(_LINK.sub("", text)):
            self.errors.append(f"{source} has a link that is not written inline, [text](address): {other}")
        return _LINK.sub(replaced, text)

    def _link(self, link: re.Match[str], page: str, source: str, docs: Path) -> str:
        """A link of the repository's file ``source`` as one of the site's ``page``, or its text if there is none."""
        picture, address, title = link["picture"], link["address"], link["title"] or ""
        text = self._links(link["text"], page, source, docs)
        path, mark, anchor = address.partition("#")
        if not path or "://" in address:
            return f"{picture}[{text}]({address}{title})"
        target = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
        if not (ROOT / target).is_file():
            if not (ROOT / target).exists():
                self.errors.append(f"{source} links to {address}, which does not exist")
            return text
        place = _OTHER_PAGES.get(target) or target.removeprefix("docs/")
        if place not in self.sources and target.endswith(".png") and not target.startswith("docs/"):
            # A picture from outside docs
            (docs / place).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / target, docs / place)
        if place not in self.sources and not (docs / place).is_file():
            return text
        return f"{picture}[{text}]({posixpath.relpath(place, posixpath.dirname(page) or '.')}{mark}{anchor}{title})"

    def _configuration(self) -> str:
        """The configuration, with the generated pages in the navigation."""
        sources = ", ".join(str(package.parent) for package in PACKAGES)
        text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").replace("[host, lab]", f"[{sources}]")
        head, navigation = text.split("\nnav:\n")
        sections = {
            part.partition(":")[0]: part.rstrip("\n") for part in re.split(r"^  - (?=\w)", navigation, flags=re.M)
        }
        for page in set(self.sources) - set(re.findall(r"^ +- (.*\.md)$", navigation, flags=re.M)):
            self.errors.append(f"the page {page} is not in the navigation of mkdocs.yml")
        sections["Host"] += "\n      - Python packages:" + "".join(
            f"\n          - api/{name}.md" for name in packages()
        )
        for variable, place, section, title in _COPIED:
            if variable in os.environ:
                sections[section] += f"\n      - {title}: {place}/index.html"
        return f"{head}\nnav:\n" + "".join(f"  - {part}\n" for part in sections.values() if part)


def packages() -> list[str]:
    """The Python packages directly under ``colonnade`` and ``colonnade_lab``."""
    found = [
        f"{package.name}.{path.parent.name}" for package in PACKAGES for path in sorted(package.glob("*/__init__.py"))
    ]
    return [name for name in found if name != "colonnade.api"]


def _front_matter(page: str) -> str:
    """The front matter of a page; a guide's is empty."""
    return "---\nsearch:\n  exclude: true\n---\n" if page.startswith(_UNSEARCHED) else ""


def _begins_block(line: str, before: str) -> bool:
    """A list or a table begins at ``line``, right after a line of a paragraph."""
    if _ITEM.match(line):
        return not _ITEM.match(before) and not before.startswith(" ")
    return bool(_ROW.match(line)) and not _ROW.match(before)


if __name__ == "__main__":
    stage = Stage()
    stage.write(Path(sys.argv[1]))
    sys.exit("\n".join(stage.errors) or None)
