"""Generates sbom.json (CycloneDX 1.6) from the locks, and checks offline that it matches them.

Versions and hashes come only from the locks. Licences come from the metadata of packages that are installed when the
file is written; the check ignores them.
"""

from __future__ import annotations

import json
import re
import sys
import xml.etree.ElementTree as ElementTree
from collections import defaultdict
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path
from typing import Any

import jars
import python_locks

ROOT = Path(__file__).resolve().parents[2]
FILE = ROOT / "sbom.json"

Component = dict[str, Any]

# The name of a Debian package's minimum version in tools/programs.sh, if it differs from the package.
_MINIMUM_OF = {"g++": "gxx", "python3": "python", "openjdk-17-jdk-headless": "java"}


def write() -> None:
    """Write sbom.json. Licences come from this environment and Coursier's cache, else from the previous file."""
    before = {part["bom-ref"]: part.get("licenses") for part in _read().get("components", [])}
    components = _components()
    for component in components:
        licences = _licences(component) or before.get(component["bom-ref"])
        if licences:
            component["licenses"] = licences
    FILE.write_text(json.dumps(_document(components), indent=1) + "\n", encoding="utf-8")


def check() -> list[str]:
    """The errors of sbom.json, one line each."""
    if not FILE.is_file():
        return ["sbom.json is missing; run: tools/lock"]
    existing = _read()
    for component in existing.get("components", []):
        component.pop("licenses", None)
    if existing != _document(_components()):
        return ["sbom.json does not match the locks; run: tools/lock"]
    return []


def _read() -> dict[str, Any]:
    if not FILE.is_file():
        return {}
    data: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return data


def _document(components: list[Component]) -> dict[str, Any]:
    project = python_locks.project_tables()["project"]
    product = {
        "type": "application",
        "bom-ref": project["name"],
        "name": project["name"],
        "version": project["version"],
        "licenses": [{"license": {"id": project["license"]["text"]}}],
    }
    head = {"bomFormat": "CycloneDX", "specVersion": "1.6", "version": 1, "metadata": {"component": product}}
    return {**head, "components": components}


def _components() -> list[Component]:
    return [*_python(), *_maven(), *_debian()]


def _python() -> list[Component]:
    hashes: dict[tuple[str, str], set[str]] = defaultdict(set)
    used: dict[tuple[str, str], list[str]] = defaultdict(list)
    for lock in python_locks.wanted_locks():
        for pin in python_locks.read(lock.path.read_text(encoding="utf-8")):
            hashes[pin.name, pin.version].update(pin.hashes)
            used[pin.name, pin.version].append(lock.name)
    return [
        _component(f"pkg:pypi/{name}@{version}", name, version, sorted(hashes[name, version]), lock=" ".join(locks))
        for (name, version), locks in sorted(used.items())
    ]


def _maven() -> list[Component]:
    hashes: dict[tuple[str, str, str], list[str]] = defaultdict(list)
    for artifact in jars.read(jars.HASHES.read_text(encoding="utf-8")):
        hashes[artifact.organization, artifact.name, artifact.version].append(artifact.sha256)
    return [
        {**_component(f"pkg:maven/{group}/{name}@{version}", name, version, sorted(found)), "group": group}
        for (group, name, version), found in sorted(hashes.items())
    ]


def _debian() -> list[Component]:
    script = (ROOT / "tools" / "programs.sh").read_text(encoding="utf-8")
    minimums = dict(re.findall(r"^minimum_(\w+)=(\S+)", script, re.MULTILINE))
    packages = {package for group in re.findall(r"missing\+=\(([^)]*)\)", script) for package in group.split()}
    components = []
    for package in sorted(packages):
        minimum = minimums.get(_MINIMUM_OF.get(package, package))
        components.append(_component(f"pkg:deb/debian/{package}", package, None, [], minimumVersion=minimum))
    return components


def _component(purl: str, name: str, version: str | None, hashes: list[str], **properties: str | None) -> Component:
    component: Component = {"type": "library", "bom-ref": purl, "name": name, "purl": purl}
    if version:
        component["version"] = version
    if hashes:
        component["hashes"] = [{"alg": "SHA-256", "content": content} for content in hashes]
    given = {key: value for key, value in properties.items() if value}
    if given:
        component["properties"] = [{"name": f"colonnade:{key}", "value": value} for key, value in given.items()]
    return component


def _licences(component: Component) -> list[Component]:
    if component["purl"].startswith("pkg:pypi/"):
        return _python_licences(component["name"], component["version"])
    if component["purl"].startswith("pkg:maven/"):
        folder = Path(*component["group"].split("."), component["name"], component["version"])
        return [{"license": {"name": name}} for name in _pom_licences(folder)]
    return []


def _python_licences(name: str, version: str) -> list[Component]:
    try:
        package = metadata(name)
    except PackageNotFoundError:
        return []
    if package["Version"] != version:
        return []
    if package["License-Expression"]:
        return [{"expression": package["License-Expression"]}]
    classifiers = [line for line in package.get_all("Classifier") or [] if line.startswith("License :: ")]
    names = [line.rsplit(" :: ", 1)[-1] for line in classifiers]
    text = package["License"] or ""
    if not names and text and "\n" not in text:
        names = [text]
    return [{"license": {"name": name}} for name in names]


def _pom_licences(folder: Path, depth: int = 0) -> list[str]:
    """The names of the licences in a module's POM or its parent's; ``folder`` is org/…/name/version."""
    pom = next(iter(jars.coursier_cache().glob(f"*/*/*/{folder}/*.pom")), None)
    if pom is None or depth > 5:
        return []
    tree = ElementTree.parse(pom).getroot()
    for element in tree.iter():  # strip the namespace
        element.tag = element.tag.rsplit("}", 1)[-1]
    names = [" ".join((found.text or "").split()) for found in tree.findall("./licenses/license/name")]
    parent = tree.find("./parent")
    if names or parent is None:
        return [name for name in names if name]
    group, name, version = (parent.findtext(key, "") for key in ("groupId", "artifactId", "version"))
    return _pom_licences(Path(*group.split("."), name, version), depth + 1)


if __name__ == "__main__":
    write()
    sys.exit(len(check()))
