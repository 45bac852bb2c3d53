#!/usr/bin/env python3
"""The comparison of all methods: what is swept, and the tables that are made of it. Called by methods.sh and two_rooms.sh.

    scenes                 names of all scenes
    file SCENE             where its file is
    prepare SCENE PART     writes out/methods/SCENE/PART/ladder.ron; prints what else `sweep` needs, a word a line
    show [SCENE]...        prints the tables of these scenes, or of all
    rooms                  prints the table of two_rooms.sh
    publish                puts all tables between their markers and the pictures beside this file
"""
import itertools
import json
import math
import os
import pathlib
import shutil
import struct
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
WORK = ROOT / "out" / "methods"
SHARED = os.environ.get("SHARED", "../shared")

PRESETS = ["default", "irradiance-2022", "lightfield-2022", "ddgi-2019", "threev8-uniform", "threev8-mixed"]
# More than 8 KiB a probe: ladders end at the scene's own spacing, beyond which a bake takes hours of a core.
LARGE = {"irradiance-2022", "lightfield-2022"}

# Spacings, m: the scene's own first; those of its curves from coarse to fine.
SCENES = {
    "two_rooms_sealed": {"spacing": 1.0},
    "two_rooms_open": {"spacing": 1.0},
    "two_rooms_open.dark": {"file": "scenes/two_rooms_open.glb", "spacing": 1.0, "words": ["--camera", "dark"]},
    "thin_wall": {"spacing": 0.75},
    "cornell": {"spacing": 0.25, "curve": [1.0, 0.7, 0.5, 0.35, 0.25, 0.18]},
    "courtyard": {"spacing": 2.0, "curve": [8.0, 5.6, 4.0, 2.8, 2.0, 1.4]},
    "office": {"spacing": 1.0, "mixed": 0.35},
    "veach_ajar": {"file": f"{SHARED}/scenes/veach_ajar/veach_ajar.glb", "spacing": 0.7},
    "bathroom": {
        "file": f"{SHARED}/scenes/bathroom/LAZIENKA.gltf",
        "spacing": 0.35,
        "words": ["--env", "1,1,1"],
        "curve": [1.4, 1.0, 0.7, 0.5, 0.35, 0.25],
        "mixed": 0.25,
    },
}

# Where a method at its published resolution would need more than 60 GB or 20 minutes of a core: settings instead.
# (scene, part, preset): settings. Rows made with them are called scaled.
SCALED = {}

# The grid of `mixed` has so many probes that all methods there see faces of 32² instead of 64².
MIXED_FACES = "capture.rays.cube.face=32"


def file_of(scene):
    return SCENES[scene].get("file", f"scenes/{scene}.glb")


def config_of(scene):
    path = pathlib.Path(file_of(scene))
    config = ROOT / "configs" / "scenes" / f"{path.stem}.ron"
    return config if config.is_file() else None


def spacing_of(scene):
    return float(os.environ.get("SPACING") or SCENES[scene]["spacing"])


def read_json(path):
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except OSError:
        return None


def sweep_of(scene, part):
    return read_json(WORK / scene / part / "sweep.json")


# Ladders


def ladder(scene, part, name, preset, settings, axes=""):
    scaled = SCALED.get((scene, part, preset), [])
    quoted = ", ".join(json.dumps(text) for text in [*settings, *scaled])
    config = config_of(scene)
    config = f'config: "{os.path.relpath(config, WORK / scene / part)}", ' if config else ""
    name += ", scaled" if scaled else ""
    return f'        (name: "{name}", preset: "{preset}", {config}set: [{quoted}]{axes}),\n'


def at_spacing(spacing):
    return [f"grid.spacing_m={spacing}"]


def positions(scene):
    return [ladder(scene, "positions", preset, preset, at_spacing(spacing_of(scene))) for preset in PRESETS]


def curves(scene):
    entries = []
    for preset in PRESETS:
        own = spacing_of(scene)
        values = [s for s in SCENES[scene].get("curve", []) if s >= own or preset not in LARGE]
        if values:
            axes = f', axes: [(key: "grid.spacing_m", values: {values})]'
            entries.append(ladder(scene, "curves", preset, preset, [], axes))
    return entries


def mixed(scene):
    if "mixed" not in SCENES[scene]:
        return []
    settings = [*at_spacing(os.environ.get("SPACING") or SCENES[scene]["mixed"]), MIXED_FACES]
    entries = [ladder(scene, "mixed", "uniform, scaled", "threev8-uniform", settings)]
    for levels in (2, 3):
        refine = f"placement.refine=mixed(levels: {levels})"
        entries.append(ladder(scene, "mixed", f"mixed, {levels} levels, scaled", "threev8-mixed", [*settings, refine]))
    return entries


def bytes_(scene):
    """Grids on which every method has about the bytes that the default has at the scene's own spacing."""
    report = sweep_of(scene, "positions")
    if report is None:
        sys.exit(f"{scene}: there is no out/methods/{scene}/positions/sweep.json; run the part 'positions' first")
    rows = {row["label"].split(",")[0]: row for row in report["configurations"]}
    budget = typical(rows["default"], "bytes")
    entries = [ladder(scene, "bytes", "default", "default", at_spacing(spacing_of(scene)))]
    for preset in PRESETS[1:]:
        probes = budget / typical(rows[preset], "bytes_per_probe")
        if preset == "threev8-mixed":
            grid = at_spacing(fitted_spacing(scene, probes, rows[preset]["probes"]))
        else:
            grid = ["grid.spacing_m=None", f"grid.divisions={fitted_divisions(extent(scene), probes)}"]
        entries.append(ladder(scene, "bytes", preset, preset, grid))
    return entries


def bake(scene, *words):
    config = config_of(scene)
    layers = ["--config", str(config)] if config else []
    env = SCENES[scene].get("words", [])
    env = env if env[:1] == ["--env"] else []
    command = [os.environ["LIGHTPROBE"], "bake", file_of(scene), *layers, *env, "-q", *words]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        sys.exit(f"{scene}: {result.stderr.strip()}")
    return result.stdout


def extent(scene):
    """Sides of the scene's box, m, from the spacing of a grid of 2 × 2 × 2: a cell less a twentieth on either side."""
    path = WORK / scene / "extent.probes"
    few = ["grid.spacing_m=None", "grid.divisions=(2,2,2)", "capture.rays.cube.face=1"]
    bake(scene, "--preset", "threev8-uniform", "-o", str(path), *(word for text in few for word in ("--set", text)))
    data = path.read_bytes()
    header = json.loads(data[8 : 8 + struct.unpack("<Q", data[:8])[0]])
    return [0.9 * spacing for spacing in json.loads(header["__metadata__"]["grid"])["spacing"]]


def fitted_divisions(sides, probes):
    """Of the grids whose spacings differ least among the axes that of nearest this number of probes: within 3 % any."""
    found = set()
    for step in range(600):
        spacing = 2 * max(sides) * 0.99**step
        exact = [side / spacing + 1.1 for side in sides]
        found.update(itertools.product(*([max(1, math.floor(n)), max(1, math.ceil(n))] for n in exact)))

    def badness(divisions):
        # As `grid.divisions` lays them out; a single layer has the side for its spacing.
        spacings = [side / (n - 1.1) if n > 1 else side for side, n in zip(sides, divisions)]
        off = abs(math.log(math.prod(divisions) / probes))
        return max(off, 0.03), max(spacings) / min(spacings), divisions

    return "({},{},{})".format(*min(found, key=badness))


def fitted_spacing(scene, probes, known):
    """The spacing of a mixed grid of about so many probes; `known` has it at the scene's own spacing."""
    best = None
    middle = math.log(spacing_of(scene)) + math.log(known / probes) / 3
    low, high = middle - 1, middle + 1
    for _ in range(10):
        spacing = float(f"{math.exp((low + high) / 2):.4g}")
        settings = [f"grid.spacing_m={spacing}", "capture.rays.cube.face=1"]
        words = [word for text in settings for word in ("--set", text)]
        count = json.loads(bake(scene, "--preset", "threev8-mixed", *words, "--dry-run", "--json"))["probes"]
        off = abs(math.log(count / probes))
        if best is None or off < best[0]:
            best = off, spacing
        if count > probes:
            low = math.log(spacing)
        else:
            high = math.log(spacing)
    return best[1]


PARTS = {"positions": positions, "bytes": bytes_, "curves": curves, "mixed": mixed}


def prepare(scene, part):
    folder = WORK / scene / part
    entries = PARTS[part](scene)
    if not entries:
        return
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "ladder.ron").write_text("(\n    ladders: [\n" + "".join(entries) + "    ],\n)\n", encoding="utf-8")
    (WORK / scene / "machine.txt").write_text(machine(), encoding="utf-8")
    words = [file_of(scene), *SCENES[scene].get("words", [])]
    words += {"positions": ["--equal", "positions"], "curves": ["--equal", "bytes"]}.get(part, [])
    print("\n".join(words))


def machine():
    try:
        lines = pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unknown processor")


# Tables


def typical(configuration, key):
    figure = configuration["figures"][key]
    return figure["mean"] if figure["geometric_mean"] is None else figure["geometric_mean"]


def significant(value, digits=3):
    """With so many digits, and no more zeros than the number has."""
    if value == 0:
        return "0"
    decimals = max(digits - 1 - math.floor(math.log10(abs(value))), 0)
    return f"{round(value, decimals):,.{decimals}f}"


def percent(value):
    if value is None:
        return "–"
    return "< 0.001 %" if 0 < 100 * value < 0.001 else f"{significant(100 * value)} %"


def seconds(value):
    return "–" if value is None else f"{significant(value)} s"


def milliseconds(value):
    return "–" if value is None else f"{significant(value)} ms"


def size(value):
    if value is None:
        return "–"
    for unit in ("B", "KiB", "MiB"):
        if value < 1024 or unit == "MiB":
            return f"{significant(value)} {unit}"
        value /= 1024
    return None


FIGURES = [
    ("error", "error_relative", percent),
    ("corners", "error_corner", percent),
    ("elsewhere", "error_flat", percent),
    ("in air", "air_error", percent),
    ("black in air", "air_black", percent),
    ("leak light", "leak_light", percent),
    ("leak dark", "leak_dark", percent),
    ("blocks", "leak_blocks", percent),
    ("dark region", "leak_dark_region", percent),
    ("bake", "bake_s", seconds),
    ("shade", "shade_ms", milliseconds),
    ("bytes a probe", "bytes_per_probe", lambda value: "–" if value is None else f"{value:,.0f}"),
    ("in all", "bytes", size),
]


def markdown(head, rows):
    lines = ["| " + " | ".join(head) + " |", "|---|" + "--:|" * (len(head) - 1)]
    return "\n".join([*lines, *("| " + " | ".join(row) + " |" for row in rows)])


def caption(scene, report):
    samples = report["reference"]["spp"]
    path = WORK / scene / "machine.txt"
    processor = path.read_text(encoding="utf-8") if path.is_file() else "unknown processor"
    return (
        f"Camera `{report['camera']}`, {report['width']}×{report['height']}, reference of {samples} samples a pixel; "
        f"times of {report['threads']} threads of {processor}."
    )


def best(rows, key):
    """The least of a figure, where several have it."""
    values = [value for value in (typical(row, key) for row in rows) if value is not None]
    return min(values) if len(values) > 1 else None


def full_table(report, held):
    rows = report["configurations"]
    least = {key: best(rows, key) for _, key, _ in FIGURES if key.startswith(("error", "air"))}
    head = ["method", "probes", *(name for name, _, _ in FIGURES)]
    own = typical(rows[0], "bytes")
    lines = []
    for row in rows:
        cells = [f"`{row['label']}`", f"{row['probes']:,}"]
        for _, key, form in FIGURES:
            value = typical(row, key)
            text = form(value)
            cells.append(f"**{text}**" if value is not None and value == least.get(key) else text)
        if held == "bytes":
            cells.append(significant(typical(row, "bytes") / own))
        lines.append(cells)
    return markdown([*head, "÷ `default`'s"] if held == "bytes" else head, lines)


def full_tables(part, scenes):
    blocks = []
    for scene in scenes:
        report = sweep_of(scene, part)
        if report is not None:
            blocks.append(f"**{scene}**. {caption(scene, report)}\n\n{full_table(report, part)}")
    return "\n\n".join(blocks) if blocks else "Nothing was run."


def geometric_mean(values):
    values = [value for value in values if value]
    return math.exp(sum(map(math.log, values)) / len(values)) if values else None


def short_table(scenes):
    """A row for each method: its error in each scene on equal positions and on equal bytes, and what it costs."""
    reports = {scene: [sweep_of(scene, part) for part in ("positions", "bytes")] for scene in scenes}
    reports = {scene: pair for scene, pair in reports.items() if pair[0] is not None}
    rows = []
    for preset in PRESETS:
        cells, costs = [f"`{preset}`"], {"bytes_per_probe": [], "bake_s": [], "shade_ms": []}
        for pair in reports.values():
            parts = []
            for report in pair:
                all_rows = report["configurations"] if report else []
                row = next((row for row in all_rows if row["label"].split(",")[0] == preset), None)
                value = typical(row, "error_relative") if row else None
                text = "–" if value is None else significant(100 * value, 2)
                parts.append(f"**{text}**" if value is not None and value == best(all_rows, "error_relative") else text)
            cells.append(" · ".join(parts))
            first = pair[0]["configurations"]
            row = next((row for row in first if row["label"].split(",")[0] == preset), None)
            for key, ratios in costs.items():
                if row:
                    ratios.append(typical(row, key) / typical(first[0], key))
        cells += ["–" if mean is None else f"{significant(mean)} ×" for mean in map(geometric_mean, costs.values())]
        rows.append(cells)
    return markdown(["method", *reports, "bytes a probe", "bake", "shade"], rows)


def mixed_table(scenes):
    """Each grid of `mixed`, and what it has and errs relative to the uniform one."""
    blocks = []
    keys = [("probes", None), ("bytes", "bytes"), ("bake", "bake_s")]
    errors = [(name, key) for name, key, _ in FIGURES if key in ("error_relative", "error_corner", "error_flat", "air_error")]
    for scene in scenes:
        report = sweep_of(scene, "mixed")
        if report is None:
            continue
        rows = report["configurations"]
        lines = []
        for row in rows:
            cells = [row["label"], f"{row['probes']:,}", size(typical(row, "bytes")), seconds(typical(row, "bake_s"))]
            for _, key in errors:
                value, uniform = typical(row, key), typical(rows[0], key)
                ratio = f" (× {significant(value / uniform)})" if row is not rows[0] and value and uniform else ""
                cells.append(percent(value) + ratio)
            lines.append(cells)
        head = ["grid", *(name for name, _ in keys), *(name for name, _ in errors)]
        finest = os.environ.get("SPACING") or SCENES[scene]["mixed"]
        lead = f"**{scene}**, finest spacing {finest} m, cube faces of 32² (scaled). {caption(scene, report)}"
        blocks.append(f"{lead}\n\n{markdown(head, lines)}")
    return "\n\n".join(blocks) if blocks else "Nothing was run."


def at_budgets(scenes):
    """Each method's error along its curve, at the same bytes."""
    blocks = []
    for scene in scenes:
        report = sweep_of(scene, "curves")
        budgets = report["equal"]["budgets"] if report else []
        if not budgets:
            continue
        rows = []
        for budget in budgets:
            errors = [entry["error_relative"] for entry in budget["entries"]]
            least = min((error for error in errors if error is not None), default=None)
            texts = [percent(error) for error in errors]
            rows.append([size(budget["bytes"]), *(f"**{t}**" if e is not None and e == least else t for e, t in zip(errors, texts))])
        head = ["bytes in all", *(f"`{entry['method']}`" for entry in budgets[0]["entries"])]
        blocks.append(f"**{scene}**. {caption(scene, report)}\n\n{markdown(head, rows)}")
    return "\n\n".join(blocks) if blocks else "Nothing was run."


# Two rooms with 16 probes each

ROOMS = ["two_rooms_sealed", "two_rooms_open"]
# Luo 2022: memory a probe and shading time on an RTX 2070.
PUBLISHED = {"irradiance-2022": ("149.25 KiB", "1.1 ms"), "lightfield-2022": ("576 KiB", "1.1 ms")}
ROOMS_ROWS = ["default", "default.walls", *PRESETS[1:]]
VISIBILITY = {"irradiance-2022": "none", "lightfield-2022": "Chebyshev³", "default": "table at surfaces"}
VISIBILITY["default.walls"] = "table at surfaces, grid to the walls"
VISIBILITY |= {"ddgi-2019": "Chebyshev³", "threev8-uniform": "Chebyshev", "threev8-mixed": "Chebyshev"}


def room(scene, preset, camera):
    report = read_json(WORK / "rooms" / f"{scene}.{preset}" / camera / "report.json")
    if report is None:
        return None, {}
    methods = {method["name"]: method for method in report["methods"]}
    return report, methods["visibility_on"]


def rooms_row(scene, preset):
    (_, lit), (_, dark), (_, outside) = (room(scene, preset, camera) for camera in ("lit", "dark", "outside"))
    if not lit:
        return None
    mean = lit["irradiance_indirect_mean"]
    baked = read_json(WORK / "rooms" / f"{scene}.{preset}" / "bake.json")
    return {
        "shade": lit["shade_ms"]["median"],
        "lookup": lit["lookup_ns"],
        # In full, as the published figures count.
        "bytes": baked["bytes_per_probe"]["runtime"],
        "leak": lit["leak"]["light"],
        "leak_dark_room": dark["leak"]["light"],
        "dark": (dark["irradiance_indirect_mean"] or 0) / mean if mean else None,
        "outside": (outside["irradiance_indirect_mean"] or 0) / mean if mean else None,
        "error": (lit.get("error") or {}).get("nrmse"),
    }


def rooms_table():
    blocks = []
    head = ["method", "visibility", "shading", "published", "a look-up", "memory a probe", "published", "leak.light", "… dark room"]
    head += ["dark room ÷ lit room", "outer faces ÷ lit room", "error"]
    found = {}
    for scene in ROOMS:
        lines = []
        for preset in ROOMS_ROWS:
            row = rooms_row(scene, preset)
            if row is None:
                continue
            found[scene, preset] = row
            memory, time = PUBLISHED.get(preset, ("–", "–"))
            lookup = "–" if row["lookup"] is None else f"{row['lookup']:.0f} ns"
            cells = [f"`{preset.split('.')[0]}`", VISIBILITY[preset], milliseconds(row["shade"]), time, lookup, size(row["bytes"]), memory]
            cells += [percent(row[key]) for key in ("leak", "leak_dark_room", "dark", "outside", "error")]
            lines.append(cells)
        if lines:
            report, _ = room(scene, "default", "lit")
            threads = f"{report['threads']} threads" if report else "one machine"
            blocks.append(f"**{scene}**, 4 × 2 × 2 probes; times of {threads}.\n\n{markdown(head, lines)}")
    if not blocks:
        return "Nothing was run."
    return "\n\n".join(blocks + ["\n".join(findings(found))])


def findings(found):
    """Whether what was published is seen here."""
    get = lambda scene, preset, key: (found.get((scene, preset)) or {}).get(key)
    without, with_ = (get(ROOMS[0], preset, "dark") for preset in ("irradiance-2022", "lightfield-2022"))
    lines = []
    verdict = lambda holds: "reproduced" if holds else "contradicted"
    if without is not None and with_ is not None:
        lines.append(
            f"* No leak with visibility: {verdict(with_ < 0.01 and with_ < without)}. The sealed dark room shows "
            f"{percent(without)} of the lit room's light without visibility and {percent(with_)} with it "
            f"(`default`: {percent(get(ROOMS[0], 'default', 'dark'))}); the bound for “no leak” here is 1 %."
        )
    times = [get(scene, preset, "shade") for scene in ROOMS for preset in ("irradiance-2022", "lightfield-2022")]
    if all(times):
        ratio = math.sqrt(times[1] / times[0] * times[3] / times[2])
        lines.append(
            f"* Equal shading time: {verdict(abs(math.log(ratio)) < math.log(1.1))}. Shading with visibility takes "
            f"{significant(ratio)} times as long as without (published: 1.1 ms each); the bound for “equal” here is 10 %."
        )
    faces = get(ROOMS[0], "lightfield-2022", "outside")
    if faces is not None:
        lines.append(
            f"* Outer faces lit by interpolation: {verdict(faces > 0.01)}. With visibility the outer faces, which are "
            f"black in truth, show {percent(faces)} of the lit room's light (without: "
            f"{percent(get(ROOMS[0], 'irradiance-2022', 'outside'))}; `default`: {percent(get(ROOMS[0], 'default', 'outside'))})."
        )
    return lines


# What readers see

CURVES = [("error_time", "time", "error against bake time"), ("error_shading", "shading", "error against shading time")]
HERE = pathlib.Path(__file__).resolve().parent


def pictures():
    """What publishing copies: source, target."""
    sheet = WORK / os.environ.get("SHEET", "two_rooms_open.dark") / "positions" / "contact.png"
    yield sheet, HERE / "methods.png"
    for scene in (scene for scene, of in SCENES.items() if "curve" in of):
        for name, short, _ in CURVES:
            for ending in ("png", "svg"):
                yield WORK / scene / "curves" / f"{name}.{ending}", HERE / f"methods.{scene}.{short}.{ending}"


def curves_table():
    rows = []
    for scene in (scene for scene, of in SCENES.items() if "curve" in of):
        names = [f"../../scripts/readme/methods.{scene}.{short}" for _, short, _ in CURVES]
        if all((HERE / f"methods.{scene}.{short}.png").is_file() for _, short, _ in CURVES):
            rows.append([scene, *(f"![]({name}.png) [SVG]({name}.svg)" for name in names)])
    return markdown(["", *(title for *_, title in CURVES)], rows) if rows else "Nothing was drawn."


def show(scenes):
    for title, text in sections(scenes):
        print(f"\n## {title}\n\n{text}")


def sections(scenes):
    picture = "\n\n![](scripts/readme/methods.png)" if (HERE / "methods.png").is_file() else ""
    return [
        ("short", short_table(scenes) + picture),
        ("positions", full_tables("positions", scenes)),
        ("bytes", full_tables("bytes", scenes)),
        ("curves", curves_table()),
        ("budgets", at_budgets(scenes)),
        ("mixed", mixed_table(scenes)),
        ("rooms", rooms_table()),
    ]


def put(path, name, text):
    """Replaces what stands between a file's markers of this name."""
    begin, end = f"<!-- methods {name}: begin -->", f"<!-- methods {name}: end -->"
    whole = path.read_text(encoding="utf-8")
    if whole.count(begin) != 1 or whole.count(end) != 1 or whole.index(begin) > whole.index(end):
        sys.exit(f"{path}: the markers {begin} and {end} must stand there once, in this order")
    before, rest = whole.split(begin)
    after = rest.split(end)[1]
    path.write_text(f"{before}{begin}\n{text}\n{end}{after}", encoding="utf-8")


def publish():
    for source, target in pictures():
        if source.is_file():
            shutil.copyfile(source, target)
        else:
            print(f"{source.relative_to(ROOT)} is not there: {target.name} stays as it is", file=sys.stderr)
    for name, text in sections(list(SCENES)):
        path = ROOT / "README.md" if name == "short" else ROOT / "configs" / "presets" / "README.md"
        put(path, name, text)


def known(scene):
    if scene not in SCENES:
        sys.exit(f"there is no scene '{scene}'; there are {' '.join(SCENES)}")
    return scene


def main():
    command, *words = sys.argv[1:] or ["help"]
    if command == "scenes":
        print(" ".join(SCENES))
    elif command == "file" and len(words) == 1:
        print(file_of(known(words[0])))
    elif command == "prepare" and len(words) == 2:
        if words[1] not in PARTS:
            sys.exit(f"there is no part '{words[1]}'; there are {' '.join(PARTS)}")
        prepare(known(words[0]), words[1])
    elif command == "show":
        show([known(scene) for scene in words] or list(SCENES))
    elif command == "rooms":
        print(rooms_table())
    elif command == "publish":
        publish()
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main()
