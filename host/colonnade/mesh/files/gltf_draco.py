"""The primitives of glTF files that KHR_draco_mesh_compression compresses."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy.typing as npt

from colonnade.mesh.files.draco import DracoMesh, decode_draco
from colonnade.mesh.files.gltf_document import DRACO, GltfDocument


@dataclass(frozen=True)
class PrimitiveArrays:
    """The arrays of a primitive, from its accessors or its Draco stream.

    Attributes:
        document: Its document.
        primitive: Its JSON.
        mesh: The decoded stream; None: its accessors hold the data.
    """

    document: GltfDocument
    primitive: Mapping[str, Any]
    mesh: DracoMesh | None

    def attribute(self, name: str) -> npt.NDArray[Any]:
        """The values of an attribute that the primitive has, [vertices, components], as `GltfDocument.array`."""
        accessor = self.primitive["attributes"][name]
        if self.mesh is None or name not in self.primitive["extensions"][DRACO].get("attributes", {}):
            return self.document.array(accessor)
        values = self.mesh.attributes.get(self.primitive["extensions"][DRACO]["attributes"][name])
        if values is None:
            raise self.document.error(f"the Draco data of a primitive have no {name}: export it again")
        return self.document.decoded(accessor, values)

    def indices(self) -> npt.NDArray[Any] | None:
        """The vertices in their order, [corners, 1]; None: that of the attributes."""
        if self.mesh is not None:
            # The decoder does not keep the order of the corners, so no change would meet its corner
            index = self.primitive.get("indices")
            if index is not None and "sparse" in self.document.entry("accessors", index):
                raise self.document.error("the indices of a Draco primitive are sparse: export it again")
            return self.mesh.faces.reshape(-1, 1)
        return self.document.array(self.primitive["indices"]) if "indices" in self.primitive else None


class DracoPrimitives:
    """The compressed primitives of a document, all of them decoded when the first one is asked for."""

    def __init__(self, document: GltfDocument) -> None:
        self._document = document
        self._meshes: dict[int, DracoMesh] | None = None

    def arrays(self, primitive: Mapping[str, Any]) -> PrimitiveArrays:
        """The arrays of a primitive; uncompressed ones if it has both."""
        view = self._view(primitive)
        if view is None:
            return PrimitiveArrays(self._document, primitive, None)
        if self._meshes is None:
            primitives = (one for mesh in self._document.json["meshes"] for one in mesh.get("primitives", []))
            views = sorted({found for one in primitives if (found := self._view(one)) is not None})
            streams = [self._document.view_bytes(number) for number in views]
            self._meshes = dict(zip(views, decode_draco(streams), strict=True))
        return PrimitiveArrays(self._document, primitive, self._meshes[view])

    def _view(self, primitive: Mapping[str, Any]) -> int | None:
        """The buffer view of a primitive's stream; None if its accessors hold its data."""
        extension, attributes = primitive.get("extensions", {}).get(DRACO), primitive.get("attributes", {})
        if extension is None or "POSITION" not in attributes:
            return None
        if "bufferView" in self._document.entry("accessors", attributes["POSITION"]):
            return None
        if not isinstance(extension.get("attributes"), Mapping):
            raise self._document.error("a primitive's Draco use has no attributes: export it again")
        view = extension.get("bufferView")
        self._document.entry("bufferViews", view)
        return int(view)
