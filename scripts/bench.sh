#!/usr/bin/env bash
# How near the capture comes to bare Embree, and where a bake's time goes. Ratios within one run only: seconds of
# different machines, or of one machine at different hours, do not compare.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/bench.sh

Sets up, builds, and bakes each scene three times with all threads and three times with one, in turn, with
--measure-raw. Prints medians over the three runs:

  capture/bare    rays per second of the capture ÷ those of bare Embree on the same rays in the same order
  rays/s          of the capture
  load … write    share of the stages' time, all threads (the replay of the bare rays is no stage)
  capture ×       rays per second of the capture with all threads ÷ with one
  bake ×          sum of the stages' times with one thread ÷ with all

Then runs the benchmarks of look-ups, filter and bounces (scripts/bench/probes.rs, one thread) and prints what each look-up
takes as a ratio to the default's, and the change of each against the run before, where there was one.

Scenes: office, courtyard (sky 0.6,0.8,1.2), two_rooms_sealed, and from ../shared/scenes, where they are there,
veach_ajar and bathroom (sky 1,1,1). Reports stay in out/bench/.
LIGHTPROBE names a binary to use instead of building one." "$@"

provide_lightprobe

runs=3
work=out/bench
names=()

# Bakes with all threads and with one in turn, so that a slow minute of the machine strikes both.
measure() { # NAME SCENE ARGUMENTS...
    local name=$1 scene=$2 run
    shift 2
    if [[ ! -f $scene ]]; then
        say "no $scene here, left out"
        return
    fi
    names+=("$name")
    for ((run = 1; run <= runs; run++)); do
        say "$name, run $run of $runs"
        bake "$name.all.$run" "$scene" "$@"
        bake "$name.one.$run" "$scene" "$@" --threads 1
    done
}

bake() { # REPORT SCENE ARGUMENTS...
    local report=$1
    shift
    "$lightprobe" bake "$@" -o "$work/bench.probes" --measure-raw --json --quiet >"$work/$report.json" ||
        die "the bake of $1 failed"
}

rm -rf -- "$work"
mkdir -p "$work"
measure office scenes/office.glb --config configs/scenes/office.ron
measure courtyard scenes/courtyard.glb --config configs/scenes/courtyard.ron --env 0.6,0.8,1.2
measure two_rooms_sealed scenes/two_rooms_sealed.glb --config configs/scenes/two_rooms_sealed.ron
measure veach_ajar ../shared/scenes/veach_ajar/veach_ajar.glb
measure bathroom ../shared/scenes/bathroom/LAZIENKA.gltf --env 1,1,1

python3 - "$work" "$runs" "${names[@]}" <<'PY'
import json, statistics, sys

work, runs, names = sys.argv[1], int(sys.argv[2]), sys.argv[3:]
STAGES = ["load", "accel_build", "survey", "capture", "bounces", "fit", "filter", "encode", "write"]


def reports(name, kind):
    for run in range(1, runs + 1):
        with open(f"{work}/{name}.{kind}.{run}.json", encoding="utf-8") as file:
            yield json.load(file)


def stages_s(report):
    return sum(report["time_s"][stage] for stage in STAGES)


def ratio(over, under):
    return over / under if over is not None and under else float("nan")


def row(name):
    everyone, one = list(reports(name, "all")), list(reports(name, "one"))
    pairs = list(zip(everyone, one))
    median = lambda values: statistics.median(values)
    cells = [name, str(everyone[0]["threads"])]
    for runs_of in (everyone, one):
        cells.append(f"{median(ratio(r['rays_per_s'], r['raw_embree_rays_per_s']) for r in runs_of):.2f}")
    cells.append(f"{median(r['rays_per_s'] or 0 for r in everyone) / 1e6:.2f} M")
    cells += [f"{100 * median(r['time_s'][stage] / stages_s(r) for r in everyone):.1f} %" for stage in STAGES]
    cells.append(f"{median(ratio(a['rays_per_s'], b['rays_per_s']) for a, b in pairs):.2f}")
    cells.append(f"{median(stages_s(b) / stages_s(a) for a, b in pairs):.2f}")
    return cells


head = ["scene", "threads", "capture/bare", "with 1 thread", "rays/s", *STAGES, "capture ×", "bake ×"]
rows = [head] + [row(name) for name in names]
widths = [max(len(r[i]) for r in rows) for i in range(len(head))]
for r in rows:
    print("  ".join(c.ljust(w) if i == 0 else c.rjust(w) for i, (c, w) in enumerate(zip(r, widths))).rstrip())
PY

# Look-ups, filter and bounces: medians in ns, and ratios within this run.
say 'look-ups, filter, bounces'
cargo bench --locked --quiet --bench probes -- --noplot >"$work/probes.txt" 2>&1 || die "the benchmarks failed: $work/probes.txt"
python3 - "${CARGO_TARGET_DIR:-target}/criterion" <<'PY'
import json, pathlib, sys

folder = pathlib.Path(sys.argv[1])
POINTS = 4096  # of scripts/bench/probes.rs


def median(path, kind):
    file = path / kind / "estimates.json"
    return json.loads(file.read_text(encoding="utf-8"))["median"]["point_estimate"] if file.is_file() else None


found = {}
for file in sorted(folder.glob("**/new/benchmark.json")):
    name = json.loads(file.read_text(encoding="utf-8"))["full_id"]
    path = file.parent.parent
    # `change` holds new ÷ old − 1.
    found[name] = median(path, "new"), median(path, "change")
default = found.get("query/default", (None, None))[0]
for name, (ns, change) in found.items():
    is_query = name.startswith("query/")
    per = ns / POINTS if is_query else ns
    against = f"{ns / default:6.2f} × the default's" if is_query and default else ""
    before = f"{1 + change:6.3f} × the run before" if change is not None else ""
    print(f"{name:<48} {per:12.1f} ns  {against:<42} {before}".rstrip())
PY
