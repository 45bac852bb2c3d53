#!/usr/bin/env python3
"""Reads a probe file without lightprobe and asks it for irradiance, with the weights of the preset `default`.

    pip install numpy safetensors
    python3 scripts/readme/read_probes.py FILE.probes X Y Z NX NY NZ

Prints the irradiance (RGB, W/m²) at the world-space point X Y Z of a surface with the normal NX NY NZ.
"""

import json
import sys

import numpy as np
from safetensors import safe_open


def small_float(code, mantissa_bits):
    """Unsigned float with five bits of exponent, bias 15."""
    mantissa, exponent = code & ((1 << mantissa_bits) - 1), code >> mantissa_bits
    fraction = mantissa / (1 << mantissa_bits)
    return np.where(exponent == 0, fraction * 2.0**-14, (1 + fraction) * 2.0 ** (exponent - 15.0))


def oct_from_direction(d):
    """Octahedral map, pole +Z, to [-1, 1]²."""
    p = d[:2] / np.abs(d).sum()
    return p if d[2] >= 0 else (1 - np.abs(p[::-1])) * np.where(p >= 0, 1, -1)


class Probes:
    def __init__(self, path):
        with safe_open(path, framework="numpy") as file:
            self.meta = file.metadata()
            self.tensors = {name: file.get_tensor(name) for name in file.keys()}
        assert self.meta["format"] == "lightprobe/1", self.meta["format"]
        if "query" in self.meta:  # older files say it in their configuration
            self.check_weights(json.loads(self.meta["query"])["weights"])
        grid = json.loads(self.meta["grid"])
        self.origin, self.spacing = np.array(grid["origin"]), np.array(grid["spacing"])
        self.divisions, self.border = np.array(grid["divisions"]), grid["border"]
        self.cells = np.maximum(self.divisions - 1, 1)
        self.maps = self.unpack_irradiance()

    @staticmethod
    def check_weights(weights):
        """Refuses files that are asked in another way than this script asks."""
        plain = {"direction": "uniform", "blend": "linear", "trilinear_floor": 0.0, "weight_floor": 0.0}
        plain |= {"crush_below": 0.0, "normal_bias": 0.0, "view_bias": 0.0}
        other = [key for key, value in plain.items() if weights[key] != value]
        if weights["test"] not in ("none", {"table": {"reach_voxels": 3, "strip": 0.25}}):
            other.append("test")
        if other:
            sys.exit(f"this script has the weights of the preset default only; the file differs in {', '.join(other)}")

    def unpack_irradiance(self):
        """[P, R', R', 3], in the domain of `encoding.irradiance`, in which maps are filtered."""
        stored = self.tensors["irradiance"]
        if stored.dtype == np.uint32:  # R11G11B10F
            bits = stored.astype(np.int64)
            channels = small_float(bits & 0x7FF, 6), small_float(bits >> 11 & 0x7FF, 6), small_float(bits >> 22, 5)
            stored = np.stack(channels, axis=-1)
        return stored.astype(np.float64) * float(self.meta["scale.irradiance"])

    def probe_irradiance(self, probe, direction):
        """W/m². Bilinear, row = v, column = u; decoded afterwards."""
        side = self.maps.shape[1]
        p = (oct_from_direction(direction) * 0.5 + 0.5) * (side - 2 * self.border) - 0.5 + self.border
        p = np.clip(p, 0, side - 1)
        x, y = np.minimum(p.astype(int), max(side - 2, 0))
        fx, fy, x1, y1 = p[0] - x, p[1] - y, min(x + 1, side - 1), min(y + 1, side - 1)
        top, bottom = self.maps[probe, y], self.maps[probe, y1]
        value = (top[x] * (1 - fx) + top[x1] * fx) * (1 - fy) + (bottom[x] * (1 - fx) + bottom[x1] * fx) * fy
        return value if self.meta["encoding.irradiance"] == "linear" else 2 * np.pi * value**5

    def seen(self, base, fraction, normal):
        """Mask of the cell's eight probes that a surface sees, bit i for corner i, and a farther probe or None."""
        if "visibility" not in self.tensors:
            return 255, None  # left out by the plan: every surface sees all probes around it
        n = int(self.meta["visibility.voxels_per_cell"])
        cell = base[0] + self.cells[0] * (base[1] + self.cells[1] * base[2])
        first, end = (int(i) for i in self.tensors["visibility_start"][cell : cell + 2])
        keys = self.tensors["visibility_key"][first:end].astype(int)
        masks = self.tensors["visibility"][first:end]
        voxel = np.minimum((fraction * n).astype(int), n - 1)
        axis = int(np.abs(normal).argmax())
        facing = 2 * axis + int(normal[axis] < 0)

        def key(v):
            return (v[0] + n * (v[1] + n * v[2])) * 6 + facing

        entry = self.find(keys, key(voxel))
        if entry is None:
            entry = self.nearest(keys, voxel, facing, n)
        if entry is None:
            return 255, None
        if masks[entry]:
            return masks[entry], None
        # None of the eight: the voxel across a border that is near, else a farther probe.
        inside = fraction * n - voxel
        step = np.where(inside < 0.25, -1, np.where(inside > 0.75, 1, 0))
        step = np.where((voxel + step < 0) | (voxel + step >= n), 0, step)
        for axes in ([0], [1], [2], [0, 1], [0, 2], [1, 2], [0, 1, 2]):
            if all(step[axes]):
                neighbour = voxel.copy()
                neighbour[axes] += step[axes]
                beside = self.find(keys, key(neighbour))
                if beside is not None and masks[beside]:
                    return masks[beside], None
        far = self.tensors.get("visibility_far", np.zeros((0, 2), int))
        probe = far[far[:, 0] == first + entry, 1]
        return 0, int(probe[0]) if probe.size else None

    @staticmethod
    def find(keys, key):
        i = int(np.searchsorted(keys, key))
        return i if i < len(keys) and keys[i] == key else None

    @staticmethod
    def nearest(keys, voxel, facing, n):
        """The nearest voxel with an entry that faces the same way, else any entry of the same voxel."""
        same = np.flatnonzero(keys % 6 == facing)
        if same.size:
            of = keys[same] // 6
            offset = np.stack([of % n, of // n % n, of // n**2], axis=-1) - voxel
            return int(same[(offset**2).sum(axis=1).argmin()])
        here = np.flatnonzero(keys // 6 == voxel[0] + n * (voxel[1] + n * voxel[2]))
        return int(here[0]) if here.size else None

    def irradiance(self, position_world, normal, geometric_normal=None):
        """W/m², at a point of a surface; `geometric_normal` on the viewer's side, `normal` where not given."""
        geometric_normal = normal if geometric_normal is None else geometric_normal
        g = (position_world - self.origin) / self.spacing
        base = np.clip(np.floor(g), 0, self.cells - 1).astype(int)
        fraction = np.where(self.divisions > 1, np.clip(g - base, 0, 1), 0)
        mask, far = self.seen(base, fraction, geometric_normal)
        if far is not None:
            return self.probe_irradiance(far, normal)
        total, weights = np.zeros(3), 0.0
        for i in range(8):
            step = np.array([i & 1, i >> 1 & 1, i >> 2 & 1])
            x, y, z = np.minimum(base + step, self.divisions - 1)
            probe = x + self.divisions[0] * (y + self.divisions[1] * z)
            weight = np.where(step == 1, fraction, 1 - fraction).prod()
            if mask >> i & 1 and self.tensors["state"][probe] == 0 and weight > 0:
                total, weights = total + weight * self.probe_irradiance(probe, normal), weights + weight
        return total / weights if weights > 0 else total


def main():
    if len(sys.argv) != 8:
        sys.exit(__doc__.strip())
    point, normal = np.array(sys.argv[2:5], float), np.array(sys.argv[5:8], float)
    print(*Probes(sys.argv[1]).irradiance(point, normal / np.linalg.norm(normal)))


if __name__ == "__main__":
    main()
