"""Reads a GLB back, checks what the scenes promise, and measures it."""

import json
import struct
from collections import Counter

from .portable import add, after, cross, dot, length, rotate, subtract

MAX_BYTES = 1_000_000
# A unit normal rounded to f32 is off by at most half an ulp a component.
UNIT_TOLERANCE = 1e-6
NO_TURN, NO_MOVE, NO_SCALE = (0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
_COMPONENTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_CODES = {5126: "f", 5123: "H", 5125: "I"}


class Broken(Exception):
    """A scene does not hold what it promises."""


def _require(holds, what):
    if not holds:
        raise Broken(what)


class _Reader:
    def __init__(self, glb):
        magic, version, size = struct.unpack_from("<4sII", glb)
        _require((magic, version, size) == (b"glTF", 2, len(glb)), "GLB header")
        _require(len(glb) <= MAX_BYTES, f"{len(glb)} bytes are more than {MAX_BYTES}")
        text_size, kind = struct.unpack_from("<I4s", glb, 12)
        _require(kind == b"JSON" and text_size % 4 == 0, "JSON chunk")
        self.document = json.loads(glb[20 : 20 + text_size])
        binary_size, kind = struct.unpack_from("<I4s", glb, 20 + text_size)
        _require(kind == b"BIN\0" and 28 + text_size + binary_size == len(glb), "BIN chunk")
        self.binary = glb[28 + text_size :]
        self.unread = set(range(len(self.document["accessors"])))

    def rows(self, index):
        """An accessor's elements as tuples."""
        accessor = self.document["accessors"][index]
        view = self.document["bufferViews"][accessor["bufferView"]]
        layout = "<" + str(_COMPONENTS[accessor["type"]]) + _CODES[accessor["componentType"]]
        start, size = view["byteOffset"], struct.calcsize(layout) * accessor["count"]
        _require(
            size == view["byteLength"] and start + size <= len(self.binary) and start % 4 == 0,
            f"accessor {index} does not fill its buffer view",
        )
        rows = list(struct.iter_unpack(layout, self.binary[start : start + size]))
        if "min" in accessor:
            bounds = [[f(column) for column in zip(*rows)] for f in (min, max)]
            _require(bounds == [accessor["min"], accessor["max"]], f"bounds of accessor {index}")
        self.unread.discard(index)
        return rows


def _triangles(reader, primitive):
    """Position triples of a primitive, after checking its indices, normals and winding."""
    attributes = primitive["attributes"]
    positions, normals = reader.rows(attributes["POSITION"]), reader.rows(attributes["NORMAL"])
    _require(len(positions) == len(normals), "as many normals as positions")
    if "TEXCOORD_0" in attributes:
        _require(
            len(reader.rows(attributes["TEXCOORD_0"])) == len(positions), "as many texture coordinates as positions"
        )
    _require(all(abs(length(n) - 1) < UNIT_TOLERANCE for n in normals), "unit normals")
    indices = [row[0] for row in reader.rows(primitive["indices"])]
    _require(
        set(indices) == set(range(len(positions))) and len(indices) % 3 == 0, "indices name every vertex and no other"
    )
    triangles = []
    for corners in zip(*[iter(indices)] * 3):
        a, b, c = (positions[k] for k in corners)
        normal = cross(subtract(b, a), subtract(c, a))
        _require(length(normal) > 0, "triangles have an area")
        _require(all(dot(normal, normals[k]) > 0 for k in corners), "normals agree with the winding")
        triangles.append((a, b, c))
    return triangles


def _shells(triangles):
    """(open, volume) of every part connected by shared positions; a closed part that faces out has volume > 0."""
    leader = {}

    def find(p):
        leader.setdefault(p, p)
        while leader[p] != p:
            leader[p] = p = leader[leader[p]]
        return p

    for a, b, c in triangles:
        leader[find(b)] = find(a)
        leader[find(c)] = find(a)
    parts = {}
    for triangle in triangles:
        parts.setdefault(find(triangle[0]), []).append(triangle)
    for part in parts.values():
        edges = Counter(edge for a, b, c in part for edge in ((a, b), (b, c), (c, a)))
        is_open = any(count != edges[(q, p)] for (p, q), count in edges.items())
        volume = 0.0
        for a, b, c in part:
            volume += dot(a, cross(b, c)) / 6
        yield is_open, volume


def _instances(reader, node):
    attributes = node.get("extensions", {}).get("EXT_mesh_gpu_instancing", {}).get("attributes")
    if attributes is None:
        return [(NO_MOVE, NO_TURN, NO_SCALE)]
    columns = [reader.rows(attributes[semantic]) for semantic in ("TRANSLATION", "ROTATION", "SCALE")]
    _require(len({len(column) for column in columns}) == 1, "as many rotations and scales as translations")
    _require(all(abs(dot(q, q) + q[3] * q[3] - 1) < UNIT_TOLERANCE for q in columns[1]), "unit rotations")
    return list(zip(*columns))


def measure(glb):
    """Figures of a scene for the table; raises `Broken` where the scene is not what it should be."""
    reader = _Reader(glb)
    document = reader.document
    materials = document["materials"]
    shapes, sheets, inward, solids = [], 0, 0, 0
    for mesh in document["meshes"]:
        parts = [_triangles(reader, primitive) for primitive in mesh["primitives"]]
        emitting = sum(
            len(part)
            for part, primitive in zip(parts, mesh["primitives"])
            if any(materials[primitive["material"]].get("emissiveFactor", [0]))
        )
        triangles = [triangle for part in parts for triangle in part]
        for is_open, volume in _shells(triangles):
            sheets += is_open
            inward += not is_open and volume <= 0
            solids += not is_open and volume > 0
        shapes.append(({p for triangle in triangles for p in triangle}, len(triangles), emitting))

    low, high = [float("inf")] * 3, [float("-inf")] * 3
    total = emitters = drawn = 0
    seen = set()
    waiting = [(k, NO_MOVE, NO_TURN) for k in document["scenes"][0]["nodes"]]
    while waiting:
        k, offset, attitude = waiting.pop()
        _require(k not in seen, "every node has one parent")
        seen.add(k)
        node = document["nodes"][k]
        offset = add(offset, rotate(attitude, tuple(node.get("translation", NO_MOVE))))
        attitude = after(attitude, tuple(node.get("rotation", NO_TURN)))
        waiting.extend((child, offset, attitude) for child in node.get("children", []))
        if "mesh" not in node:
            continue
        points, count, emitting = shapes[node["mesh"]]
        for move, turn, size in _instances(reader, node):
            drawn += 1
            total += count
            emitters += emitting
            place, pose = add(offset, rotate(attitude, move)), after(attitude, turn)
            for point in points:
                p = add(place, rotate(pose, tuple(x * s for x, s in zip(point, size))))
                low, high = list(map(min, low, p)), list(map(max, high, p))
    _require(len(seen) == len(document["nodes"]), "every node is in the scene")
    _require(not reader.unread, f"accessors {sorted(reader.unread)} are not used")
    used = {node["mesh"] for node in document["nodes"] if "mesh" in node}
    _require(used == set(range(len(shapes))), "every mesh is shown")
    shown = {primitive["material"] for mesh in document["meshes"] for primitive in mesh["primitives"]}
    _require(shown == set(range(len(materials))), "every material is used")
    stored = sum(shape[1] for shape in shapes)
    lights = document.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", [])
    return {
        "bytes": len(glb),
        "triangles": total,
        "stored": stored,
        "objects": drawn,
        "low": [round(x, 3) for x in low],
        "high": [round(x, 3) for x in high],
        "solids": solids,
        "sheets": sheets,
        "inward": inward,
        "emitters": emitters,
        "cameras": [camera["name"] for camera in document.get("cameras", [])],
        "lights": [f"{light['type']} {light['name']}" for light in lights],
    }
