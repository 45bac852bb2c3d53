#!/usr/bin/env python3
"""Reads a probe file without lightprobe and asks it for irradiance, with the weights of the presets `default` and `physical`.

    pip install numpy safetensors
    python3 scripts/readme/read_probes.py FILE.probes X Y Z NX NY NZ
    python3 scripts/readme/read_probes.py FILE.probes - < POINTS

Prints the irradiance (RGB, W/m²) at the world-space point X Y Z of a surface with the normal NX NY NZ. With `-` it reads
points from standard input, one a line; three more numbers on a line are the geometric normal, where it is another one.
"""

import json
import sys

try:
    import numpy as np
    from safetensors import safe_open
except ModuleNotFoundError as missing:
    sys.exit(f"error: the Python package {missing.name} is not installed: python3 -m pip install numpy safetensors")


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
        self.reach_voxels, self.strip, self.sum_floor = 3, 0.25, 0.0
        if "query" in self.meta:  # older files say it in their configuration
            self.check_weights(json.loads(self.meta["query"])["weights"])
        grid = json.loads(self.meta["grid"])
        stored = "irradiance" in self.tensors or ("sh" in self.tensors and self.meta["sh.presampled"] == "null")
        if grid["kind"] != "uniform" or not stored:
            sys.exit("this script knows uniform grids of irradiance maps or of coefficients only")
        self.origin, self.spacing = np.array(grid["origin"]), np.array(grid["spacing"], np.float32)
        self.divisions, self.border = np.array(grid["divisions"]), grid["border"]
        self.cells = np.maximum(self.divisions - 1, 1)
        self.maps = self.unpack_irradiance() if "irradiance" in self.tensors else None
        if self.maps is None:
            scale = float(self.meta["scale.irradiance"])
            self.sh = self.tensors["sh"].astype(np.float64) * scale
            none = np.zeros((len(self.sh), 3, 3))
            self.gradient = self.tensors.get("gradient", none).astype(np.float64) * scale

    def check_weights(self, weights):
        """Refuses files that are asked in another way than this script asks."""
        self.sum_floor = weights.get("sum_floor", 0.0)
        plain = {"direction": "uniform", "blend": "linear", "trilinear_floor": 0.0, "weight_floor": 0.0}
        plain |= {"crush_below": 0.0, "normal_bias": 0.0, "view_bias": 0.0}
        plain |= {"look_up": "normal"}
        other = [key for key, value in plain.items() if weights.get(key, value) != value]
        if weights["test"] != "none":
            kind = next(iter(weights["test"]))
            if kind == "table" or kind == "everywhere" and "visibility_tree" in self.tensors:
                table = weights["test"][kind]
                self.reach_voxels, self.strip = table["reach_voxels"], table["strip"]
            else:
                other.append("test")
        if other:
            sys.exit(f"this script has the weights of the presets default and physical only; the file differs in {', '.join(other)}")

    def unpack_irradiance(self):
        """[P, R', R', 3], in the domain of `encoding.irradiance`, in which maps are filtered."""
        stored = self.tensors["irradiance"]
        if stored.dtype == np.uint32:  # R11G11B10F
            bits = stored.astype(np.int64)
            channels = small_float(bits & 0x7FF, 6), small_float(bits >> 11 & 0x7FF, 6), small_float(bits >> 22, 5)
            stored = np.stack(channels, axis=-1)
        return stored.astype(np.float64) * float(self.meta["scale.irradiance"])

    def harmonics(self, probe, d, position_world):
        """W/m², nine functions; the mean changes on the way from the probe."""
        x, y, z = d
        functions = np.array([1, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y])
        functions *= np.sqrt(np.array([1 / 4, 3 / 4, 3 / 4, 3 / 4, 15 / 4, 15 / 4, 5 / 16, 15 / 4, 15 / 16]) / np.pi)
        way = (position_world - self.origin - self.tensors["position"][probe]) / self.spacing
        return functions @ self.sh[probe] + np.sqrt(1 / 4 / np.pi) * np.clip(way, -2, 2) @ self.gradient[probe]

    def probe_irradiance(self, probe, direction, position_world):
        """W/m². Bilinear, row = v, column = u; decoded afterwards."""
        if self.maps is None:
            return self.harmonics(probe, direction, position_world)
        side = self.maps.shape[1]
        p = (oct_from_direction(direction) * 0.5 + 0.5) * (side - 2 * self.border) - 0.5 + self.border
        p = np.clip(p, 0, side - 1)
        x, y = np.minimum(p.astype(int), max(side - 2, 0))
        fx, fy, x1, y1 = p[0] - x, p[1] - y, min(x + 1, side - 1), min(y + 1, side - 1)
        top, bottom = self.maps[probe, y], self.maps[probe, y1]
        value = (top[x] * (1 - fx) + top[x1] * fx) * (1 - fy) + (bottom[x] * (1 - fx) + bottom[x1] * fx) * fy
        return value if self.meta["encoding.irradiance"] == "linear" else 2 * np.pi * value**5

    def mean_irradiance(self, probe):
        """W/m², over all directions, where coefficients hold it."""
        return np.sqrt(1 / 4 / np.pi) * self.sh[probe, 0] if self.maps is None else np.zeros(3)

    def seen(self, g, base, fraction, normal):
        """Mask of the cell's eight probes that a surface sees, bit i for corner i, and a farther probe or None."""
        if "visibility_tree" in self.tensors:
            return self.seen_in_tree(base, fraction, normal)
        if "visibility" not in self.tensors:
            return 255, None  # left out by the plan: every surface sees all probes around it
        # A file of before query version 4.
        n = int(self.meta["visibility.voxels_per_cell"])
        cell = base[0] + self.cells[0] * (base[1] + self.cells[1] * base[2])
        first, end = (int(i) for i in self.tensors["visibility_start"][cell : cell + 2])
        keys = self.tensors["visibility_key"][first:end].astype(int)
        masks = self.tensors["visibility"][first:end]
        voxel = np.minimum((fraction * np.float32(n)).astype(int), n - 1)
        axis = int(np.abs(normal).argmax())
        facing = 2 * axis + int(normal[axis] < 0)

        def key(v):
            return (v[0] + n * (v[1] + n * v[2])) * 6 + facing

        # The survey covers the probes' hull. Beyond it the nearest surface of the rim has to do.
        surveyed = len(keys) > 0 and bool(np.all(g >= 0) and np.all(g <= self.divisions - 1))
        entry = self.find(keys, key(voxel))
        if entry is None:
            entry = self.nearest(keys, voxel, facing, n, self.reach_voxels if surveyed else 2 * n)
        if entry is None:
            return (0 if surveyed else 255), None
        if masks[entry]:
            return masks[entry], None
        # None of the eight: the voxel across a border that is near, else a farther probe.
        def mask_of(v):
            entry = self.find(keys, key(v))
            return 0 if entry is None else int(masks[entry])

        if mask := self.beside(voxel, fraction, n, mask_of):
            return mask, None
        far = self.tensors.get("visibility_far", np.zeros((0, 2), int))
        probe = far[far[:, 0] == first + entry, 1]
        return 0, int(probe[0]) if probe.size else None

    def seen_in_tree(self, base, fraction, normal):
        n = int(self.meta["visibility.voxels_per_cell"])
        words = self.tensors["visibility_tree"]
        cell = base[0] + self.cells[0] * (base[1] + self.cells[1] * base[2])
        root = int(self.tensors["visibility_root"][cell])
        voxel = np.minimum((fraction * np.float32(n)).astype(int), n - 1)
        axis = int(np.abs(normal).argmax())
        facing = 2 * axis + int(normal[axis] < 0)

        def number(i):
            return int(words[i]) | int(words[i + 1]) << 16

        at, i = [*voxel, facing], root
        while (word := int(words[i])) < 1 << 15:
            of, threshold, distance, head = word >> 13, word >> 8 & 31, word & 255, 1
            below = at[of] < threshold
            if of == 3 and threshold >= 8:
                # A thin wall. On it the facing tells.
                head, beyond = 2, fraction[threshold - 8] - np.float32(words[i + 1]) / np.float32(65536)
                on_wall = abs(beyond) <= 1 / 1024 and axis == threshold - 8
                below = facing % 2 == 1 if on_wall else beyond < 0
            if distance == 0:
                i += head + 2 if below else number(i + head)
            else:
                i += head if below else distance
        return word & 255, number(i + 1) if word & 1 << 14 else None

    def beside(self, voxel, fraction, n, mask_of):
        """Mask of the voxel across a border that is near, 0 where there is none that sees anything."""
        inside = fraction * np.float32(n) - voxel.astype(np.float32)
        low, high = (inside < self.strip) & (voxel > 0), (inside > 1 - self.strip) & (voxel < n - 1)
        step = np.where(low, -1, np.where(high, 1, 0))
        for axes in ([0], [1], [2], [0, 1], [0, 2], [1, 2], [0, 1, 2]):
            if all(step[axes]):
                neighbour = voxel.copy()
                neighbour[axes] += step[axes]
                if mask := mask_of(neighbour):
                    return mask
        return 0

    @staticmethod
    def find(keys, key):
        i = int(np.searchsorted(keys, key))
        return i if i < len(keys) and keys[i] == key else None

    @staticmethod
    def nearest(keys, voxel, facing, n, reach):
        """The entry of the nearest voxel that faces the same way, at most `reach` voxels away."""
        same = np.flatnonzero(keys % 6 == facing)
        of = keys[same] // 6
        squared = ((np.stack([of % n, of // n % n, of // n**2], axis=-1) - voxel) ** 2).sum(axis=1)
        return int(same[squared.argmin()]) if same.size and squared.min() <= reach**2 else None

    def irradiance(self, position_world, normal, geometric_normal=None):
        """W/m², at a point of a surface; `geometric_normal` on the viewer's side, `normal` where not given."""
        geometric_normal = normal if geometric_normal is None else geometric_normal
        # Single precision, as in the tool: on the borders of cells and voxels the rounding decides.
        g = (position_world - self.origin).astype(np.float32) / self.spacing
        base = np.minimum(np.maximum(g, 0).astype(int), self.cells - 1)
        fraction = np.where(self.divisions > 1, np.clip(g - base.astype(np.float32), 0, 1), 0).astype(np.float32)
        mask, far = self.seen(g, base, fraction, geometric_normal)
        if far is not None:
            least = self.sum_floor * np.maximum(self.mean_irradiance(far), 0)
            return np.maximum(self.probe_irradiance(far, normal, position_world), least)
        total, mean, weights = np.zeros(3), np.zeros(3), 0.0
        for i in range(8):
            step = np.array([i & 1, i >> 1 & 1, i >> 2 & 1])
            x, y, z = np.minimum(base + step, self.divisions - 1)
            probe = x + self.divisions[0] * (y + self.divisions[1] * z)
            weight = np.where(step == 1, fraction, 1 - fraction).prod()
            if mask >> i & 1 and self.tensors["state"][probe] == 0 and weight > 0:
                total, weights = total + weight * self.probe_irradiance(probe, normal, position_world), weights + weight
                mean = mean + weight * self.mean_irradiance(probe)
        return np.maximum(total / weights, self.sum_floor * np.maximum(mean / weights, 0)) if weights > 0 else total


def unit(vector):
    return vector / np.linalg.norm(vector)


def main():
    if len(sys.argv) not in (3, 8) or (len(sys.argv) == 3 and sys.argv[2] != "-"):
        sys.exit(__doc__.strip())
    probes = Probes(sys.argv[1])
    for line in [" ".join(sys.argv[2:])] if len(sys.argv) == 8 else sys.stdin:
        numbers = np.array(line.split(), float)
        if len(numbers) not in (6, 9):
            sys.exit(f"6 or 9 numbers are wanted, not {line.strip()!r}")
        print(*probes.irradiance(numbers[:3], unit(numbers[3:6]), unit(numbers[-3:])))


if __name__ == "__main__":
    main()
