"""Binary glTF files (Khronos glTF 2.0): meshes with normals and colours, and extra data.

Vertices are in our frames, z up. The root node rotates them to y up, as other programs expect. Normals have one byte
per axis, which the extension KHR_mesh_quantization allows.
"""

import json
import struct
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import numpy as np

if TYPE_CHECKING:
    from arcor2_hw.compute.simplification import DisplayMesh

_FLOAT, _BYTE, _UINT16, _UINT32 = 5126, 5120, 5123, 5125
_VERTICES, _INDICES = 34962, 34963
_Y_UP: Final = (-0.7071067811865476, 0.0, 0.0, 0.7071067811865476)
"""Rotation by -90° about x: from z up to y up, quaternion x, y, z, w."""


def encode_glb(meshes: Mapping[str, "DisplayMesh"], extras: Mapping[str, Any]) -> bytes:
    """Return a file with one node and mesh per name, and `extras` of the scene. Equal input gives equal bytes."""
    content = _Content()
    document: dict[str, Any] = {
        "asset": {"version": "2.0", "generator": "ARCOR2-HW"},
        "scene": 0,
        "scenes": [{"nodes": [0], "extras": dict(extras)}],
        "nodes": [{"rotation": _Y_UP, "children": list(range(1, len(meshes) + 1))}],
    }
    if meshes:
        document["extensionsUsed"] = document["extensionsRequired"] = ["KHR_mesh_quantization"]
        document["nodes"] += [{"mesh": number, "name": name} for number, name in enumerate(meshes)]
        document["meshes"] = [{"name": name, "primitives": [content.primitive(mesh)]} for name, mesh in meshes.items()]
        document |= content.document()
    else:
        del document["nodes"][0]["children"]
    text = json.dumps(document, separators=(",", ":"), ensure_ascii=False).encode()
    chunks = [(b"JSON", text + b" " * (-len(text) % 4))]
    if meshes:
        chunks.append((b"BIN\0", bytes(content.data)))
    body = b"".join(struct.pack("<I4s", len(data), kind) + data for kind, data in chunks)
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


class _Content:
    """The binary chunk and its descriptions."""

    def __init__(self) -> None:
        self.data = bytearray()
        self._views: list[dict[str, Any]] = []
        self._accessors: list[dict[str, Any]] = []

    def document(self) -> dict[str, Any]:
        return {"buffers": [{"byteLength": len(self.data)}], "bufferViews": self._views, "accessors": self._accessors}

    def primitive(self, mesh: "DisplayMesh") -> dict[str, Any]:
        positions = np.ascontiguousarray(mesh.positions, dtype="<f4")
        bounds = {"min": positions.min(axis=0).tolist(), "max": positions.max(axis=0).tolist()}
        attributes = {"POSITION": self._add(positions, _FLOAT, "VEC3", _VERTICES, **bounds)}
        padded = np.zeros((len(mesh.normals), 4), dtype=np.int8)  # vertices are aligned to four bytes
        padded[:, :3] = mesh.normals
        attributes["NORMAL"] = self._add(padded, _BYTE, "VEC3", _VERTICES, stride=4, normalized=True)
        if mesh.colours is not None:
            attributes["COLOR_0"] = self._add(mesh.colours.astype("<u2"), _UINT16, "VEC4", _VERTICES, normalized=True)
        short = len(positions) <= 65535
        indices = mesh.triangles.ravel().astype("<u2" if short else "<u4")
        return {
            "attributes": attributes,
            "indices": self._add(indices, _UINT16 if short else _UINT32, "SCALAR", _INDICES),
        }

    def _add(self, values: Any, component: int, kind: str, target: int, *, stride: int = 0, **more: Any) -> int:
        data = values.tobytes()
        view: dict[str, Any] = {
            "buffer": 0, "byteOffset": len(self.data), "byteLength": len(data), "target": target,
        }  # fmt: skip
        if stride:
            view["byteStride"] = stride
        self.data += data + bytes(-len(data) % 4)
        self._views.append(view)
        accessor = {"bufferView": len(self._views) - 1, "componentType": component, "count": len(values), "type": kind}
        self._accessors.append(accessor | more)
        return len(self._accessors) - 1
