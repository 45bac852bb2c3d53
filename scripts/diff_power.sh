#!/usr/bin/env bash
# How often noise alone fails the default thresholds, and how small a change of all light is still caught.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/diff_power.sh

Bakes and renders scenes at a spacing each, fine and far too coarse, with the seeds 0 to 20. Compares twenty candidates with a base that
differs in its seed only: one other seed, and eight others side by side. Then bakes with the lamps some percent brighter, and looks for
the least change that is caught in 19 of 20: with one other seed, with eight, and with the same. RUNS='cornell:0.25 office:1' chooses scenes and spacings (m),
PRESET another preset than the default. LIGHTPROBE names a binary to use instead of building one." "$@"

provide_lightprobe
mkdir -p "out/power/${PRESET:-default}"

python3 - "$lightprobe" "out/power/${PRESET:-default}" "${RUNS:-cornell:0.25 two_rooms_open:0.5 two_rooms_open:1 two_rooms_open:2 courtyard:2 office:2}" <<'PYTHON'
import json
import os
import shutil
import struct
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

program, folder, runs = sys.argv[1], Path(sys.argv[2]), sys.argv[3].split()
PAIRS, NEEDED, SEEDS = 20, 19, 8
PERCENTS = [0.3, 0.5, 0.75, 1, 1.5, 2, 3, 4, 6]


def brighter(scene, factor):
    """The scene with all that emits brighter."""
    path = folder / f"{scene}_{factor:.4f}.glb"
    if path.exists():
        return path
    data = Path(f"scenes/{scene}.glb").read_bytes()
    length = struct.unpack("<I", data[12:16])[0]
    document, rest = json.loads(data[20 : 20 + length]), data[20 + length :]
    for material in document["materials"]:
        if "emissiveFactor" in material:
            strength = material["extensions"]["KHR_materials_emissive_strength"]
            strength["emissiveStrength"] *= factor
    for light in document.get("extensions", {}).get("KHR_lights_punctual", {}).get("lights", []):
        light["intensity"] = light.get("intensity", 1) * factor
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    head = b"glTF" + struct.pack("<III", 2, 20 + len(text) + len(rest), len(text)) + b"JSON"
    # Whole from the first moment: others may be waiting for it.
    whole = path.with_suffix(f".{threading.get_ident()}")
    whole.write_bytes(head + text + rest)
    whole.rename(path)
    return path


def make(scene, spacing, percent, seed):
    """A folder with the probe file, the report of the bake, and a render of every camera."""
    side = folder / f"{scene}_{spacing}_{percent}_{seed}"
    if not (side / "done").exists():
        side.mkdir(exist_ok=True)
        path = brighter(scene, 1 + percent / 100)
        common = ["-q", "--seed", str(seed)]
        bake = [program, "bake", path, "-o", side / "a.probes", "--report", side / "bake.json"]
        subprocess.run([*bake, "--preset", folder.name, "--set", f"grid.spacing_m={spacing}", *common], check=True, stdout=subprocess.DEVNULL)
        render = [program, "render", path, side / "a.probes", "-o", side / "run", "--camera", "all", "--size", "96x54"]
        subprocess.run([*render, *common], check=True, stdout=subprocess.DEVNULL)
        (side / "done").touch()
    return side


def failing(a, b):
    page = folder / f"diff_{threading.get_ident()}"
    command = [program, "diff-report", a, b, "-o", page, "--json", "--allow-scene-change"]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode < 2, run.stderr
    return [g["name"] for g in json.loads(run.stdout)["gates"] if not g["passed"] and not g["waived"]]


def several(sides, candidate):
    """A base of the eight seeds after the candidate's."""
    base = folder / f"several_{candidate}"
    shutil.rmtree(base, ignore_errors=True)
    base.mkdir()
    for step in range(1, SEEDS + 1):
        (base / str(step)).symlink_to(sides[(candidate + step) % len(sides)].resolve())
    return base


def every(compare):
    """What a comparison says of every pair."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(compare, range(PAIRS)))


for run in runs:
    scene, spacing = run.split(":")
    sides = [make(scene, spacing, 0, seed) for seed in range(PAIRS + 1)]
    bases = {
        "one other seed": lambda i: sides[i + 1],
        f"{SEEDS} other seeds": lambda i: several(sides, i),
        "equal seeds": lambda i: sides[i],
    }
    for what, base in bases.items():
        found = every(lambda i: failing(base(i), sides[i]))
        print(f"{scene} {spacing} m, {what}: {sum(map(bool, found))} of {PAIRS} fail {[f for f in found if f]}", flush=True)
        for percent in PERCENTS:
            caught = sum(every(lambda i: bool(failing(base(i), make(scene, spacing, percent, i)))))
            print(f"  {what}: {percent} % brighter is caught in {caught} of {PAIRS}", flush=True)
            if caught >= NEEDED:
                break
        else:
            print(f"  {what}: up to {PERCENTS[-1]} % no change is caught in {NEEDED}", flush=True)
PYTHON
