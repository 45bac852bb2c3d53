"""The measurements of scaling.sh, which calls this: scaling.py PROGRAM yes|no."""

import array
import itertools
import json
import math
import os
import pathlib
import statistics
import struct
import subprocess
import sys
import time

PROGRAM, LONG = sys.argv[1], sys.argv[2] == "yes"
RUNS = 3
OUT = pathlib.Path("out/bench")
OUT.mkdir(parents=True, exist_ok=True)
PROBES = OUT / "scaling.probes"
STAGES = ["survey", "capture", "bounces", "fit"]
OFFICE = ["scenes/office.glb", "--config", "configs/scenes/office.ron"]


def run(words):
    started = time.monotonic()
    done = subprocess.run([PROGRAM, "bake", *words, "--json", "-q"], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"bake {' '.join(words)} failed: {done.stderr}")
    return json.loads(done.stdout), time.monotonic() - started


def bake(words, runs=RUNS):
    """Medians of the stages' times and of the peak memory."""
    reports = [run([*words, "-o", str(PROBES)])[0] for _ in range(runs)]
    middle = lambda of: statistics.median(of(report) for report in reports)
    found = {stage + "_s": middle(lambda r, s=stage: r["time_s"][s]) for stage in STAGES}
    found["stages_s"] = middle(lambda r: sum(r["time_s"][stage] for stage in STAGES))
    found["load_s"] = middle(lambda r: r["time_s"]["load"] + r["time_s"]["accel_build"])
    found["total_s"] = middle(lambda r: r["time_s"]["total"])
    found["peak_bytes"] = middle(lambda r: r["peak_memory_bytes"])
    found["probes"], found["threads"] = reports[0]["probes"], reports[0]["threads"]
    return found


def exponent(points):
    """Slope of the line through log x, log y by least squares."""
    logs = [(math.log(x), math.log(y)) for x, y in points if x > 0 and y > 0]
    if len(logs) < 2:
        return None
    mx, my = (statistics.fmean(c) for c in zip(*logs))
    return sum((x - mx) * (y - my) for x, y in logs) / sum((x - mx) ** 2 for x, _ in logs)


def glb(positions, triangles, lights=()):
    """A scene of one double-sided grey material that has no light but these, at points, or else glows."""
    # `sum` of tuples takes the square of their number.
    flat = lambda kind, rows: array.array(kind, itertools.chain.from_iterable(rows)).tobytes()
    vertices, indices = flat("f", positions), flat("I", triangles)
    low, high = ([f(p[i] for p in positions) for i in range(3)] for f in (min, max))
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": list(range(1 + len(lights)))}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [
            {
                "pbrMetallicRoughness": {"baseColorFactor": [0.6, 0.6, 0.6, 1], "metallicFactor": 0},
                "emissiveFactor": [0, 0, 0] if lights else [0.5, 0.5, 0.5],
                "doubleSided": True,
            }
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(positions), "type": "VEC3", "min": low, "max": high},
            {"bufferView": 1, "componentType": 5125, "count": 3 * len(triangles), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": len(vertices)},
            {"buffer": 0, "byteOffset": len(vertices), "byteLength": len(indices)},
        ],
        "buffers": [{"byteLength": len(vertices) + len(indices)}],
    }
    if lights:
        document["extensionsUsed"] = ["KHR_lights_punctual"]
        document["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 1.0 / len(lights)}]}}
        for place in lights:
            document["nodes"].append({"translation": place, "extensions": {"KHR_lights_punctual": {"light": 0}}})
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    size = 12 + 8 + len(text) + 8 + len(vertices) + len(indices)
    head = struct.pack("<4sII", b"glTF", 2, size) + struct.pack("<I4s", len(text), b"JSON")
    return head + text + struct.pack("<I4s", len(vertices) + len(indices), b"BIN\0") + vertices + indices


def room(floor, lights=()):
    """A room of 4 m × 2.5 m × 4 m whose floor is waves of `floor` × `floor` squares."""
    at = lambda i, j: (4 * i / floor, 0.1 + 0.1 * math.sin(9 * i / floor) * math.cos(7 * j / floor), 4 * j / floor)
    positions = [at(i, j) for j in range(floor + 1) for i in range(floor + 1)]
    triangles = []
    for j in range(floor):
        for i in range(floor):
            a = i + j * (floor + 1)
            triangles += [(a, a + floor + 1, a + 1), (a + 1, a + floor + 1, a + floor + 2)]
    base = len(positions)
    positions += [(x, y, z) for x in (0.0, 4.0) for y in (0.0, 2.5) for z in (0.0, 4.0)]
    for a, b, c, d in [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]:
        triangles += [(base + a, base + b, base + c), (base + a, base + c, base + d)]
    return glb(positions, triangles, lights)


def write_room(floor, lights=()):
    path = OUT / "scaling.glb"
    path.write_bytes(room(floor, lights))
    return [str(path)]


def probes():
    found = []
    for count in [100, 1000, 10_000] + ([100_000] if LONG else []):
        # 1,080 at 1 m.
        spacing = (1080 / count) ** (1 / 3)
        found.append(bake([*OFFICE, "--set", f"grid.spacing_m={spacing:.4f}"], 1 if count > 10_000 else RUNS))
    return "probes", found


def triangles():
    found = []
    for count in [10_000, 100_000, 1_000_000] + ([10_000_000] if LONG else []):
        scene = write_room(round(math.sqrt(count / 2)))
        found.append({"triangles": count, **bake([*scene, "--set", "grid.divisions=(4,4,4)"])})
    return "triangles", found


def lights():
    places = lambda n: [[0.2 + 3.6 * (i * 0.618 % 1), 2.2, 0.2 + 3.6 * (i * 0.414 % 1)] for i in range(n)]
    words = ["--set", "grid.divisions=(6,4,6)"]
    return "lights", [{"lights": n, **bake([*write_room(10, places(n)), *words])} for n in (1, 16, 256)]


def threads():
    every = os.cpu_count() or 1
    counts = [n for n in (1, 2, 4, 8, 16, 32, 64) if n < every] + [every]
    found = [bake([*OFFICE, "--threads", str(n)]) for n in counts]
    for of in found:
        for stage in [*(s + "_s" for s in STAGES), "stages_s"]:
            of["efficiency_" + stage[:-2]] = found[0][stage] / of[stage] / of["threads"] if of[stage] else None
    return "threads", found


def bounces():
    words = [*OFFICE, "--preset", "physical", "--set", "transport.bounces.acceleration=never"]
    words += ["--set", "transport.bounces.tolerance=0"]
    return "bounces", [{"bounces": n, **bake([*words, "--set", f"transport.bounces.max_bounces={n}"])} for n in (1, 4, 16)]


def budget():
    words = ["scenes/cornell.glb", "--preset", "physical", "--set", "grid.spacing_m=0.12"]
    found = []
    for mib in (0, 64, 128, 256, 1024):
        found.append({"budget_mib": mib, **bake([*words, "--memory-budget", f"{mib}MiB"])})
    return "budget_mib", found


def dry_run():
    scenes = {
        "office": OFFICE,
        "courtyard": ["scenes/courtyard.glb", "--config", "configs/scenes/courtyard.ron", "--env", "0.6,0.8,1.2"],
        "two_rooms_open": ["scenes/two_rooms_open.glb", "--set", "grid.spacing_m=0.5"],
        "cornell": ["scenes/cornell.glb", "--set", "grid.spacing_m=0.15"],
        "thin_wall": ["scenes/thin_wall.glb", "--set", "grid.spacing_m=0.4"],
        "veach_ajar": ["../shared/scenes/veach_ajar/veach_ajar.glb"],
    }
    found = []
    for name, words in scenes.items():
        if not pathlib.Path(words[0]).is_file():
            continue
        predicted, dry_s = min((run([*words, "--dry-run"]) for _ in range(RUNS)), key=lambda p: p[1])
        baked = bake(words)
        found.append({
            "scene": name,
            "dry_s": dry_s,
            "share": dry_s / baked["total_s"],
            "time_ratio": predicted["predicted_time_s"] / baked["stages_s"],
            "memory_ratio": predicted["predicted_memory_bytes"] / baked["peak_bytes"],
            **{s + "_ratio": predicted["predicted_" + s + "_s"] / baked[s + "_s"] for s in ("survey", "capture", "fit")},
            **baked,
        })
    return "scene", found


def plot(name, key, rows, columns):
    """Lines of log x, log y as SVG."""
    points = [(row[key], row[column], column) for row in rows for column in columns if row.get(column)]
    points = [(x, y, c) for x, y, c in points if x > 0 and y > 0]
    if not points:
        return
    logs = [[math.log10(p[i]) for p in points] for i in (0, 1)]
    (x0, x1), (y0, y1) = ((math.floor(min(l)), math.ceil(max(l) + 1e-9)) for l in logs)
    px = lambda x: 70 + 420 * (math.log10(x) - x0) / max(x1 - x0, 1)
    py = lambda y: 330 - 300 * (math.log10(y) - y0) / max(y1 - y0, 1)
    out = ['<svg xmlns="http://www.w3.org/2000/svg" width="660" height="380" font-family="sans-serif" font-size="12">']
    out.append('<rect width="660" height="380" fill="white"/>')
    for k in range(x0, x1 + 1):
        out.append(f'<path d="M{px(10**k):.1f} 30V330" stroke="#ddd"/><text x="{px(10**k):.1f}" y="346" text-anchor="middle">{10**k:g}</text>')
    for k in range(y0, y1 + 1):
        out.append(f'<path d="M70 {py(10**k):.1f}H490" stroke="#ddd"/><text x="64" y="{py(10**k) + 4:.1f}" text-anchor="end">{10**k:g}</text>')
    for column, color in zip(columns, ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#555555", "#e69f00"]):
        line = [(px(x), py(y)) for x, y, c in points if c == column]
        if line:
            out.append(f'<polyline points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in line)}" fill="none" stroke="{color}" stroke-width="2"/>')
            out.append(f'<text x="496" y="{line[-1][1] + 4:.1f}" fill="{color}">{column}</text>')
    out.append(f'<text x="280" y="370" text-anchor="middle">{key}</text><text x="70" y="20">{name}</text></svg>')
    (OUT / f"{name}.svg").write_text("\n".join(out), encoding="utf-8")


def show(name, key, rows):
    columns = [c for c in rows[0] if c == key or c not in ("threads", "probes")]
    text = lambda v: f"{v:.3g}" if isinstance(v, float) else str(v)
    table = [columns] + [[text(row[c]) for c in columns] for row in rows]
    widths = [max(len(r[i]) for r in table) for i in range(len(columns))]
    print(f"\n{name}")
    for r in table:
        print("  ".join(c.rjust(w) for c, w in zip(r, widths)))
    if isinstance(rows[0][key], (int, float)):
        slope = exponent([(row[key], row["stages_s"]) for row in rows])
        print(f"exponent of the stages' time: {slope:.2f}" if slope is not None else "")


found = {}
for measure in (probes, triangles, lights, threads, bounces, budget, dry_run):
    key, rows = measure()
    name = measure.__name__
    found[name] = rows
    show(name, key, rows)
    if key != "scene":
        times = ["stages_s", *(s + "_s" for s in STAGES)]
        plot(name, key, rows, times if name != "budget" else ["peak_bytes"])
    (OUT / "scaling.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
PROBES.unlink(missing_ok=True)
(OUT / "scaling.glb").unlink(missing_ok=True)
