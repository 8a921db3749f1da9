"""MkDocs hooks: what the site has beyond the pages of docs/.

- README, CHANGELOG, CONTRIBUTING and SECURITY become pages, so that each text exists once.
- Each Python package of host/colonnade gets a page of its docstrings; those of the Python API follow docs/api.md.
- Scaladoc, PeakRDL's register pages and the page of tools/browser are copied into the site, from the folders that the
  environment variables COLONNADE_SCALADOC, COLONNADE_REGISTERS and COLONNADE_BROWSER name.
- Links are written for the repository (``../SECURITY.md``); here they are pointed at the site's pages. Of a link to a
  source file only the text stays. A link to a file that the repository lacks is a warning, and the build is strict.
- GitHub's Markdown needs no blank line before a list or a table; Python-Markdown does.
"""

from __future__ import annotations

import logging
import os
import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "host" / "colonnade"
_log = logging.getLogger("mkdocs.hooks.colonnade")

# Files of the root and the pages that they become.
_ROOT_PAGES = {
    "README.md": "index.md",
    "CHANGELOG.md": "changelog.md",
    "CONTRIBUTING.md": "contributing.md",
    "SECURITY.md": "security.md",
}
#: Folders of finished pages: environment variable, place, section, title.
_COPIED = (
    ("COLONNADE_SCALADOC", "scala", "Hardware by stage", "Scaladoc"),
    ("COLONNADE_REGISTERS", "registers", "Integration", "Register pages"),
    ("COLONNADE_BROWSER", "browser", "Host", "Browser tab"),
)
#: The pages that docstrings follow, and the modules.
_REFERENCES = {"api.md": ("colonnade.api.scene", "colonnade.device.device", "colonnade.device.shell_device")}
#: Weight in the search of pages that hold many words and explain few. A guide has 1; words of a title count 1000 times.
_SEARCH_WEIGHTS = {"api/": 1e-4, "changelog.md": 0.1, "hardening.md": 0.3}
_LINK = re.compile(r"(!?)\[([^\]]*)\]\(([^)\s]+)\)")
_FENCE = re.compile(r"^\s*(```|~~~)")
_ITEM = re.compile(r"^([-*+]|\d+\.) ")
_ROW = re.compile(r"^\|.*\|\s*$")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Append the generated pages to the navigation."""
    nav = config.nav
    assert nav is not None
    sections = {name: entries for section in nav for name, entries in section.items()}
    sections["Host"].append({"Python packages": [f"api/{name}.md" for name in _packages()]})
    for variable, place, section, title in _COPIED:
        if _folder(variable):
            sections[section].append({title: f"{place}/index.html"})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages and files that are not in docs/."""
    for source, page in _ROOT_PAGES.items():
        files.append(File.generated(config, page, abs_src_path=str(ROOT / source)))
    for name in _packages():
        files.append(File.generated(config, f"api/{name}.md", content=f"# {name}\n\n::: {name}\n"))
    for variable, place, _, _ in _COPIED:
        folder = _folder(variable)
        for path in sorted(file for file in folder.rglob("*") if file.is_file()) if folder else ():
            relative = path.relative_to(folder).as_posix()
            if not relative.startswith((".", "launcher")):
                files.append(File.generated(config, f"{place}/{relative}", abs_src_path=str(path)))
    # Pictures that pages show from outside docs/
    sources = [*_ROOT_PAGES, *(f"docs/{path.name}" for path in (ROOT / "docs").glob("*.md"))]
    for target in sorted({target for source in sources for target in _targets(source)}):
        if target.suffix == ".png" and (ROOT / target).is_file() and not target.is_relative_to("docs"):
            files.append(File.generated(config, target.as_posix(), abs_src_path=str(ROOT / target)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Point links at the site's pages, and separate lists and tables from the paragraph before them.

    The search finds the guides first, then the docstrings of packages.
    """
    for start, weight in _SEARCH_WEIGHTS.items():
        if page.file.src_uri.startswith(start):
            page.meta["search"] = {"boost": weight}
    origin = {place: source for source, place in _ROOT_PAGES.items()}.get(page.file.src_uri)
    source = origin or f"docs/{page.file.src_uri}"
    lines: list[str] = []
    is_code = False
    for line in markdown.split("\n"):
        if _FENCE.match(line):
            is_code = not is_code
        elif not is_code:
            line = _LINK.sub(lambda link: _on_site(link, source, page.file.src_uri, files), line)
            if lines and lines[-1].strip() and _begins_block(line, lines[-1]):
                lines.append("")
        lines.append(line)
    references = _REFERENCES.get(page.file.src_uri, ())
    return "\n".join([*lines, *(f"\n::: {module}\n" for module in references)])


def _begins_block(line: str, before: str) -> bool:
    """A list or a table begins at ``line``, right after a line of a paragraph."""
    if _ITEM.match(line):
        return not _ITEM.match(before) and not before.startswith(" ")
    return bool(_ROW.match(line)) and not _ROW.match(before)


def _on_site(link: re.Match[str], source: str, page: str, files: Files) -> str:
    """Turn a link of the repository's file ``source`` into one of the site's ``page``, or to text if there is none."""
    picture, text, address = link.groups()
    path, mark, anchor = address.partition("#")
    if not path or "://" in address:
        return link[0]
    target = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
    if not (ROOT / target).exists():
        _log.warning("%s links to %s, which does not exist", source, address)
        return link[0]
    place = _ROOT_PAGES.get(target) or target.removeprefix("docs/")
    if files.get_file_from_path(place) is None:
        return str(text)
    return f"{picture}[{text}]({posixpath.relpath(place, posixpath.dirname(page) or '.')}{mark}{anchor})"


def _targets(source: str) -> list[Path]:
    """The repository's files that a file of it links to."""
    if not (ROOT / source).is_file():
        return []
    links = (found[3].partition("#")[0] for found in _LINK.finditer((ROOT / source).read_text(encoding="utf-8")))
    folder = posixpath.dirname(source)
    return [Path(posixpath.normpath(posixpath.join(folder, link))) for link in links if link and "://" not in link]


def _packages() -> list[str]:
    """The Python packages directly under ``colonnade``, and those of its laboratory."""
    host = sorted(path.parent.name for path in PACKAGE.glob("*/__init__.py") if path.parent.name not in ("api", "lab"))
    laboratory = sorted(f"lab.{path.parent.name}" for path in PACKAGE.glob("lab/*/__init__.py"))
    return [f"colonnade.{name}" for name in (*host, *laboratory)]


def _folder(variable: str) -> Path | None:
    folder = os.environ.get(variable)
    return Path(folder) if folder else None
