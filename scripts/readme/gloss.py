#!/usr/bin/env python3
"""Gloss of three methods in glossy_room with its floor and spheres at one roughness: the tables under "Glossy light" of
configs/presets/README.md, and the pictures behind them in out/gloss.

    gloss.py            bakes, renders and prints both tables; what is there is not made again
    gloss.py roughness  prints the table of roughnesses alone
    gloss.py texels     prints the table of maps' sizes alone

LIGHTPROBE names the binary (lightprobe), THREADS its threads, SIZE and SPP other pictures.
"""
import json
import os
import pathlib
import struct
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
WORK = ROOT / "out" / "gloss"
LIGHTPROBE = os.environ.get("LIGHTPROBE", "lightprobe")

ROUGHNESSES = [0.1, 0.3, 0.6]
# Texels along a side of all maps, and those of the table of roughnesses.
TEXELS = [32, 64, 128, 256]
MARCHED, LEVELS = 256, 64
# The roughness of the table of sizes.
MIDDLE = 0.3

# Probes within the room, none of them behind its walls; rays are taken to end at its inner faces.
GRID = ["grid.divisions=(5,3,5)", 'grid.bounds={"min":[-2.5,0.4,-2],"max":[2.5,2.6,2]}']
PROXY = "query.glossy=prefiltered(parallax: box(min: (-3, 0, -2.5), max: (3, 3, 2.5)))"


def levels(texels):
    return "[" + ",".join(str(texels >> k) for k in range(5)) + "]"


def settings(method, texels):
    """What scales a method to maps of this size."""
    coarse = min(texels, 16)
    return {
        # Its one bounce would leave the ceiling black, which only reflected light reaches.
        "irradiance-2022": [
            "transport.bounces.max_bounces=None",
            f"capture.rays.cube.face={texels}",
            f"capture.rays.cube.resolution={texels}",
            f"store.irradiance.octahedral.resolution={coarse}",
            f"store.prefiltered={levels(texels)}",
            PROXY,
        ],
        "default": [
            f"capture.rays=octahedral(resolution: {texels}, per_texel: 1, guided: 0)",
            f"store.prefiltered={levels(texels)}",
            "store.prefilter=ggx",
            PROXY,
        ],
        "mcguire-2017": [
            f"capture.rays.octahedral.resolution={texels}",
            f"store.light_field=march(lowest: {texels // 16})",
            f"store.irradiance.octahedral.resolution={coarse}",
            f"store.occlusion.moments.resolution={coarse}",
        ],
    }[method]


METHODS = ["irradiance-2022", "default", "mcguire-2017"]


def room(roughness):
    """glossy_room with its floor and its spheres of one roughness, as a file."""
    path = WORK / f"room{roughness}.glb"
    if not path.is_file():
        data = (ROOT / "scenes" / "glossy_room.glb").read_bytes()
        length = struct.unpack("<I", data[12:16])[0]
        document, rest = json.loads(data[20 : 20 + length]), data[20 + length :]
        for material in document["materials"]:
            if material["name"].startswith("metal_") or material["name"] == "glossy_floor":
                material["pbrMetallicRoughness"]["roughnessFactor"] = roughness
        text = json.dumps(document, separators=(",", ":")).encode()
        text += b" " * (-len(text) % 4)
        header = struct.pack("<4sII", b"glTF", 2, 20 + len(text) + len(rest)) + struct.pack("<I4s", len(text), b"JSON")
        path.write_bytes(header + text + rest)
    return path


def run(*words):
    command = [LIGHTPROBE, *words, "--threads", os.environ.get("THREADS", "0"), "-q"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(f"lightprobe {' '.join(words)}: {done.stderr.strip()}")


def view():
    return ["--camera", "main", "--size", os.environ.get("SIZE", "192x108")]


def reference(roughness):
    path = WORK / f"reference{roughness}.exr"
    if not path.is_file():
        spp = os.environ.get("SPP", "512")
        run("reference", str(room(roughness)), "-o", str(path), "--spp", spp, "--transport", "gltf", *view())
    return path


def gloss(method, roughness, texels):
    """What `render` says of a method's gloss."""
    name = f"{method}.{roughness}.{texels}"
    probes, folder = WORK / f"{name}.probes", WORK / name
    if not (folder / "report.json").is_file():
        words = [word for text in [*GRID, *settings(method, texels)] for word in ("--set", text)]
        run("bake", str(room(roughness)), "--preset", method, *words, "-o", str(probes))
        against = ["--reference-image", str(reference(roughness))]
        run("render", str(room(roughness)), str(probes), "-o", str(folder), *against, *view())
        probes.unlink()
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    return next(m["glossy"] for m in report["methods"] if m["name"] == "visibility_on")


def both(error):
    """Relative RMSE, which mirrored lamps rule, and the mean relative squared error of all pixels."""
    return f"{100 * error['nrmse']:.0f} %, {error['relmse']:.2f}"


def markdown(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|---|---|" + "--:|" * (len(head) - 2)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def roughness_table():
    rows = []
    for roughness in ROUGHNESSES:
        for method in METHODS:
            found = gloss(method, roughness, MARCHED if method == "mcguire-2017" else LEVELS)
            parts = {part["name"]: both(part["error_gltf"]) for part in found["parts"]}
            names = ["without_parallax", "exact_visibility", "exact_parallax", "exact_light"]
            cells = [str(roughness), f"`{method}`", both(found["error_gltf"]), *(parts.get(name, "") for name in names)]
            traced = found.get("traced")
            cells.append(f"{100 * traced['lost']:.1f} %" if traced else "")
            rows.append([*cells, f"{found['bytes_per_probe'] / 1024:.3g} KiB"])
    head = ["roughness", "method", "error", "no parallax", "exact visibility", "and exact ends", "exact light: the model"]
    return markdown([*head, "rays lost", "gloss a probe"], rows)


def texels_table():
    rows = []
    for method in METHODS:
        found = [gloss(method, MIDDLE, texels) for texels in TEXELS]
        rows.append([f"`{method}`", "error", *(both(of["error_gltf"]) for of in found)])
        rows.append(["", "gloss a probe", *(f"{of['bytes_per_probe'] / 1024:.3g} KiB" for of in found)])
    return markdown(["method", "", *(f"{texels}²" for texels in TEXELS)], rows)


def main():
    if {"-h", "--help"} & set(sys.argv[1:]):
        sys.exit(print(__doc__.strip()))
    asked = sys.argv[1:] or ["roughness", "texels"]
    if not set(asked) <= {"roughness", "texels"}:
        sys.exit(__doc__)
    WORK.mkdir(parents=True, exist_ok=True)
    tables = {"roughness": roughness_table, "texels": texels_table}
    print("\n\n".join(tables[name]() for name in asked))


if __name__ == "__main__":
    main()
