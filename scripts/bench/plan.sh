#!/usr/bin/env bash
# What the plan leaves out of a bake, and what that saves. Times compare within one run only.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/../lib.sh"

only_help "usage: scripts/bench/plan.sh

Bakes each scene with its plan and with plan=keep_everything, in turn, three times each, and prints for each scene

  left out      stages that the plan leaves out
  file, peak    bytes of the probe file, and the process's largest memory: with the plan, without, and what is saved
  time          all stages, the median of three: with the plan, without, and what is saved
  same          whether probes that both bakes hold are equal bit by bit

then what each line of the plan says that it saved. All of it goes to out/bench/plan.json too.

Scenes: those of scenes/ and, where they are there, of ../shared/scenes.
LIGHTPROBE names a binary to use instead of building one." "$@"

provide_lightprobe

exec python3 - "$lightprobe" <<'PY'
import json, pathlib, statistics, struct, subprocess, sys

program, runs = sys.argv[1], 3
out = pathlib.Path("out/bench")
out.mkdir(parents=True, exist_ok=True)
SCENES = {
    "office": ["scenes/office.glb", "--config", "configs/scenes/office.ron"],
    "courtyard": ["scenes/courtyard.glb", "--config", "configs/scenes/courtyard.ron", "--env", "0.6,0.8,1.2"],
    "cornell": ["scenes/cornell.glb", "--config", "configs/scenes/cornell.ron"],
    "two_rooms_open": ["scenes/two_rooms_open.glb", "--config", "configs/scenes/two_rooms_open.ron"],
    "two_rooms_sealed": ["scenes/two_rooms_sealed.glb", "--config", "configs/scenes/two_rooms_sealed.ron"],
    "glossy_room": ["scenes/glossy_room.glb", "--config", "configs/scenes/glossy_room.ron"],
    "furnace": ["scenes/furnace.glb", "--config", "configs/scenes/furnace.ron"],
    "thin_wall": ["scenes/thin_wall.glb", "--config", "configs/scenes/thin_wall.ron"],
    "veach_ajar": ["../shared/scenes/veach_ajar/veach_ajar.glb"],
    "bathroom": ["../shared/scenes/bathroom/LAZIENKA.gltf", "--env", "1,1,1"],
}
STAGES = ["survey", "capture", "bounces", "fit", "filter", "encode"]
NAMES = ["irradiance", "sh", "gradient"]


def bake(name, words, kind):
    path = out / f"plan.{kind}.probes"
    sets = ["--set", "plan=keep_everything"] if kind == "full" else []
    command = [program, "bake", *words, *sets, "-o", str(path), "--json", "-q"]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"the bake of {name} failed: {done.stderr}")
    return json.loads(done.stdout), path


def tensors(path):
    bytes_ = path.read_bytes()
    length = struct.unpack("<Q", bytes_[:8])[0]
    header = json.loads(bytes_[8 : 8 + length])
    data = bytes_[8 + length :]
    cut = lambda entry: data[slice(*entry["data_offsets"])]
    return {name: (entry["shape"], cut(entry)) for name, entry in header.items() if name != "__metadata__"}


def same(lean, full):
    a, b = tensors(lean), tensors(full)
    for name in (n for n in NAMES if n in a):
        row = len(a[name][1]) // a[name][0][0]
        for probe, state in enumerate(a["state"][1]):
            cut = slice(probe * row, (probe + 1) * row)
            if state == 0 and (b["state"][1][probe] != 0 or a[name][1][cut] != b[name][1][cut]):
                return False
    return True


def measure(name, words):
    times, peaks, files, reports, equal = {}, {}, {}, {}, True
    for _ in range(runs):
        paths = {}
        for kind in ("lean", "full"):
            report, paths[kind] = bake(name, words, kind)
            times.setdefault(kind, []).append(sum(report["time_s"][stage] for stage in STAGES))
            peaks.setdefault(kind, []).append(report["peak_memory_bytes"])
            files[kind], reports[kind] = paths[kind].stat().st_size, report
        equal &= same(paths["lean"], paths["full"])
    [path.unlink() for path in paths.values()]
    middle = lambda found: {kind: statistics.median(values) for kind, values in found.items()}
    lines = [{k: line[k] for k in ("stage", "kept", "reason", "saved_bytes", "saved_s")} for line in reports["lean"]["plan"]]
    return {"scene": name, "file_bytes": files, "peak_bytes": middle(peaks), "time_s": middle(times), "same": equal, "plan": lines}


def table(rows):
    widths = [max(len(r[i]) for r in rows) for i in range(len(rows[0]))]
    for r in rows:
        print("  ".join(c.ljust(w) if i in (0, len(r) - 1) else c.rjust(w) for i, (c, w) in enumerate(zip(r, widths))).rstrip())


found = [measure(name, words) for name, words in SCENES.items() if pathlib.Path(words[0]).is_file()]
(out / "plan.json").write_text(json.dumps(found, indent=1), encoding="utf-8")
kib = lambda n: f"{n / 1024:.0f}"
rows = [["scene", "same", "file KiB", "full", "peak MiB", "full", "time s", "full", "left out"]]
for r in found:
    left = ", ".join(line["stage"] for line in r["plan"] if not line["kept"])
    file, peak, time = r["file_bytes"], r["peak_bytes"], r["time_s"]
    rows.append([r["scene"], "yes" if r["same"] else "NO", kib(file["lean"]), kib(file["full"]), kib(peak["lean"] / 1024),
                 kib(peak["full"] / 1024), f"{time['lean']:.2f}", f"{time['full']:.2f}", left])
table(rows)
print()
rows = [["scene", "saved KiB", "saved s", "stage"]]
for r in found:
    for line in r["plan"]:
        if line["saved_bytes"] is not None or line["saved_s"] is not None:
            show = lambda value, text: "" if value is None else text(value)
            rows.append([r["scene"], show(line["saved_bytes"], kib), show(line["saved_s"], lambda s: f"{s:.2f}"), line["stage"]])
table(rows)
sys.exit(0 if all(r["same"] for r in found) else 1)
PY
