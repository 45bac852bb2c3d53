"""A scene under construction and its bytes as glTF 2.0 binary.

Layout: accessor k has buffer view k, the images' views follow; all start at multiples of 4 bytes. Numbers in the buffer
are rounded to f32 here; those in JSON are shortest decimals of f64 rounded to `_DECIMALS`.
"""

import json
import struct

from .portable import NO_TURN, look, subtract

GENERATOR = "lightprobe make_scenes.py"
_DECIMALS = 9
_FLOAT, _USHORT, _UINT = 5126, 5123, 5125
_VERTICES, _INDICES = 34962, 34963
_NEAREST, _REPEAT = 9728, 10497
_PUNCTUAL, _STRENGTH, _INSTANCING = (
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "EXT_mesh_gpu_instancing",
)


def _rounded(numbers):
    return [round(number, _DECIMALS) + 0.0 for number in numbers]  # + 0.0 turns −0 into 0


def _packed(numbers):
    return struct.pack(f"<{len(numbers)}f", *(number + 0.0 for number in numbers))


class Scene:
    """Everything is named; a node belongs to the scene's root unless it has a parent."""

    def __init__(self, name, description):
        self._binary = bytearray()
        self._primitives = (
            {}
        )  # (geometry, with uv) -> accessors, so that meshes of other materials share their vertices
        self._used = set()
        self._required = set()
        self._lists = {
            key: []
            for key in (
                "accessors",
                "bufferViews",
                "cameras",
                "images",
                "materials",
                "meshes",
                "nodes",
                "samplers",
                "textures",
            )
        }
        self._lights = []
        self._roots = []
        self._name = name
        self._description = description

    # Materials

    def material(
        self, name, color, emission=None, metallic=0, roughness=1, texture=None, mask=None, double_sided=False
    ):
        """Diffuse unless stated; `emission` is radiance in W/m²/sr; `mask` the alpha below which there is a hole."""
        surface = {"baseColorFactor": _rounded([*color, 1]), "metallicFactor": metallic, "roughnessFactor": roughness}
        material = {"name": name, "pbrMetallicRoughness": surface}
        if texture is not None:
            surface["baseColorTexture"] = {"index": texture}
        if mask is not None:
            material.update(alphaMode="MASK", alphaCutoff=mask)
        if double_sided:
            material["doubleSided"] = True
        if emission is not None:
            strength = max(emission)
            material["emissiveFactor"] = _rounded(channel / strength for channel in emission)
            if strength != 1:
                self._used.add(_STRENGTH)
                material["extensions"] = {_STRENGTH: {"emissiveStrength": strength}}
        return self._append("materials", material)

    def texture(self, name, png):
        """An embedded PNG, without interpolation, repeated."""
        view = {"data": png}  # its buffer view is made last, after those of the accessors
        image = self._append("images", {"name": name, "mimeType": "image/png", "bufferView": view})
        if not self._lists["samplers"]:
            self._append("samplers", {"magFilter": _NEAREST, "minFilter": _NEAREST, "wrapS": _REPEAT, "wrapT": _REPEAT})
        return self._append("textures", {"name": name, "sampler": 0, "source": image})

    # Meshes and nodes

    def mesh(self, name, *parts):
        """A mesh of (geometry, material) parts."""
        primitives = []
        for geometry, material in parts:
            textured = "baseColorTexture" in self._lists["materials"][material]["pbrMetallicRoughness"]
            primitives.append({**self._vertices(geometry, textured), "material": material})
        return self._append("meshes", {"name": name, "primitives": primitives})

    def node(self, name, mesh=None, translation=None, rotation=None, parent=None, **more):
        node = {"name": name, **more}
        if mesh is not None:
            node["mesh"] = mesh
        if translation is not None:
            node["translation"] = _rounded(translation)
        if rotation is not None and rotation != NO_TURN:
            node["rotation"] = _rounded(rotation)
        index = self._append("nodes", node)
        (self._roots if parent is None else self._lists["nodes"][parent].setdefault("children", [])).append(index)
        return index

    def object(self, name, *parts, parent=None):
        """A mesh of its own and the node that shows it once."""
        return self.node(name, self.mesh(name, *parts), parent=parent)

    def poses(self, poses):
        """Attributes of EXT_mesh_gpu_instancing for poses (translation, rotation, scale), to be shared by nodes."""
        self._used.add(_INSTANCING)
        self._required.add(_INSTANCING)  # a reader without it would show one object of the many
        columns = [[number for pose in poses for number in pose[k]] for k in range(3)]
        return {
            semantic: self._accessor(_packed(column), _FLOAT, kind, len(poses))
            for semantic, kind, column in zip(("TRANSLATION", "ROTATION", "SCALE"), ("VEC3", "VEC4", "VEC3"), columns)
        }

    def instances(self, name, mesh, poses, parent=None):
        """One mesh at all of `self.poses`."""
        return self.node(name, mesh, parent=parent, extensions={_INSTANCING: {"attributes": poses}})

    def camera(self, name, eye, target, vertical_fov_degrees):
        perspective = {
            "aspectRatio": round(16 / 9, _DECIMALS),
            "znear": 0.01,
            "yfov": round(vertical_fov_degrees * 0.017453292519943295, _DECIMALS),
        }
        camera = self._append("cameras", {"name": name, "type": "perspective", "perspective": perspective})
        self.node(name, translation=eye, rotation=look(subtract(target, eye)), camera=camera)

    def light(self, name, kind, power, position=None, direction=None, spot=None, parent=None):
        """`power`: W/m² of a directional light, W/sr of a point or spot; `spot`: inner and outer angle in radians."""
        self._used.add(_PUNCTUAL)
        intensity = max(power)
        light = {
            "name": name,
            "type": kind,
            "color": _rounded(channel / intensity for channel in power),
            "intensity": intensity,
        }
        if spot is not None:
            light["spot"] = {"innerConeAngle": spot[0], "outerConeAngle": spot[1]}
        self._lights.append(light)
        self.node(
            name,
            translation=position,
            rotation=None if direction is None else look(direction),
            parent=parent,
            extensions={_PUNCTUAL: {"light": len(self._lights) - 1}},
        )

    # Bytes

    def to_bytes(self):
        lists = {key: list(items) for key, items in self._lists.items() if items}
        for k, image in enumerate(lists.get("images", [])):
            png = image["bufferView"]["data"]
            lists["images"][k] = {**image, "bufferView": len(lists["bufferViews"])}
            lists["bufferViews"].append(self._view(png))
        document = {
            "asset": {"version": "2.0", "generator": GENERATOR, "extras": {"description": self._description}},
            "scene": 0,
            "scenes": [{"name": self._name, "nodes": self._roots}],
            "buffers": [{"byteLength": len(self._binary)}],
            **lists,
        }
        if self._used:
            document["extensionsUsed"] = sorted(self._used)
        if self._required:
            document["extensionsRequired"] = sorted(self._required)
        if self._lights:
            document["extensions"] = {_PUNCTUAL: {"lights": self._lights}}
        text = json.dumps(document, separators=(",", ":"), sort_keys=True, allow_nan=False).encode("ascii")
        text += b" " * (-len(text) % 4)
        size = 12 + 8 + len(text) + 8 + len(self._binary)
        return (
            struct.pack("<4sII", b"glTF", 2, size)
            + struct.pack("<I4s", len(text), b"JSON")
            + text
            + struct.pack("<I4s", len(self._binary), b"BIN\0")
            + bytes(self._binary)
        )

    def _append(self, key, item):
        self._lists[key].append(item)
        return len(self._lists[key]) - 1

    def _view(self, data, target=None):
        view = {"buffer": 0, "byteOffset": len(self._binary), "byteLength": len(data)}
        if target is not None:
            view["target"] = target
        self._binary += data + bytes(-len(data) % 4)
        return view

    def _accessor(self, data, component, kind, count, target=None, **bounds):
        view = self._append("bufferViews", self._view(data, target))
        return self._append(
            "accessors", {"bufferView": view, "componentType": component, "type": kind, "count": count, **bounds}
        )

    def _vertices(self, geometry, textured):
        """Attributes and indices of a geometry, each vertex once."""
        key = (geometry, textured)
        if key not in self._primitives:
            unique, indices = {}, []
            for position, normal, uv in geometry.corners:
                vertex = (_packed(position), _packed(normal), _packed(uv) if textured else b"")
                indices.append(unique.setdefault(vertex, len(unique)))
            positions, normals, uvs = (b"".join(column) for column in zip(*unique))
            columns = list(zip(*struct.iter_unpack("<3f", positions)))
            count = len(unique)
            attributes = {
                "POSITION": self._accessor(
                    positions,
                    _FLOAT,
                    "VEC3",
                    count,
                    _VERTICES,
                    min=[min(c) for c in columns],
                    max=[max(c) for c in columns],
                ),
                "NORMAL": self._accessor(normals, _FLOAT, "VEC3", count, _VERTICES),
            }
            if textured:
                attributes["TEXCOORD_0"] = self._accessor(uvs, _FLOAT, "VEC2", count, _VERTICES)
            code, component = ("H", _USHORT) if count < 65536 else ("I", _UINT)
            packed = struct.pack(f"<{len(indices)}{code}", *indices)
            self._primitives[key] = {
                "attributes": attributes,
                "indices": self._accessor(packed, component, "SCALAR", len(indices), _INDICES),
            }
        return self._primitives[key]
