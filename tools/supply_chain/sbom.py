"""The bill of materials of setup, CycloneDX 1.6, from the locks.

Versions and hashes come only from the locks. Licences come from the lock of npm, from the
metadata of packages that are installed in the environments of this checkout, and from POM files in Coursier's cache.
"""

from __future__ import annotations

import base64
import json
import re
import sys
import xml.etree.ElementTree as ElementTree
from collections import defaultdict
from importlib.metadata import distributions
from pathlib import Path
from typing import Any

import jars
import python_locks

ROOT = Path(__file__).resolve().parents[2]

Component = dict[str, Any]

# The name of a Debian package's minimum version in tools/programs.sh, if it differs from the package.
_MINIMUM_OF = {"g++": "gxx", "python3": "python", "openjdk-17-jdk-headless": "java"}


def document() -> dict[str, Any]:
    """The bill of materials, as JSON has it."""
    components = [*_python(), *_maven(), *_npm(), *_debian()]
    for component in components:
        if licences := _licences(component):
            component["licenses"] = licences
    return {**_head(), "components": components}


def _head() -> dict[str, Any]:
    project = python_locks.project_tables()["project"]
    product = {
        "type": "application",
        "bom-ref": project["name"],
        "name": project["name"],
        "version": project["version"],
        "licenses": [{"license": {"id": project["license"]["text"]}}],
    }
    return {"bomFormat": "CycloneDX", "specVersion": "1.6", "version": 1, "metadata": {"component": product}}


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


def _npm() -> list[Component]:
    lock = json.loads((ROOT / "tools" / "lint" / "package-lock.json").read_text(encoding="utf-8"))
    components = []
    for place, package in sorted(lock["packages"].items()):
        if not place:  # the folder of the lock
            continue
        name, version = place.removeprefix("node_modules/"), package["version"]
        component = _component(f"pkg:npm/{name.replace('@', '%40')}@{version}", name, version, [], lock="npm")
        digest = base64.b64decode(package["integrity"].removeprefix("sha512-")).hex()
        licence = {"expression": package["license"]}
        components.append({**component, "hashes": [{"alg": "SHA-512", "content": digest}], "licenses": [licence]})
    return components


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
    places = [*sys.path, *map(str, (ROOT / ".cache").glob("*/lib/python*/site-packages"))]
    found = (one.metadata for one in distributions(name=name, path=places) if one.version == version)
    package = next(found, None)
    if package is None:
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
