"""What the comparison of all methods sweeps: scenes, parts, and the ladder file of each."""
import itertools
import json
import math
import os
import pathlib
import struct
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
WORK = ROOT / "out" / "methods"
SHARED = os.environ.get("SHARED", "../shared")

# In place of a table whose part was not run.
NOTHING = "Nothing was run."

PRESETS = ["physical", "default", "irradiance-2022", "lightfield-2022", "mcguire-2017", "ddgi-2019"]
PRESETS += ["threev8-uniform", "threev8-mixed"]
# More than 8 KiB a probe: ladders end at the scene's own spacing, beyond which a bake takes hours of a core.
LARGE = {"irradiance-2022", "lightfield-2022", "mcguire-2017"}

# Spacings, m: the scene's own first; those of its curves from coarse to fine.
SCENES = {
    "two_rooms_sealed": {"spacing": 1.0},
    "two_rooms_open": {"spacing": 1.0},
    "two_rooms_open.dark": {"file": "scenes/two_rooms_open.glb", "spacing": 1.0, "words": ["--camera", "dark"]},
    "thin_wall": {"spacing": 0.75},
    "cornell": {"spacing": 0.25, "curve": [1.0, 0.7, 0.5, 0.35, 0.25, 0.18]},
    "courtyard": {"spacing": 2.0, "curve": [8.0, 5.6, 4.0, 2.8, 2.0, 1.4]},
    "office": {"spacing": 1.0, "mixed": 0.35},
    # At published resolutions the two methods of cubes would take two hours of a core.
    "glossy_room": {"spacing": 0.4, "glossy": True, "maps": 64},
    "veach_ajar": {"file": f"{SHARED}/scenes/veach_ajar/veach_ajar.glb", "spacing": 0.7},
    "bathroom": {
        "file": f"{SHARED}/scenes/bathroom/LAZIENKA.gltf",
        "spacing": 0.35,
        "words": ["--env", "1,1,1"],
        "curve": [1.4, 1.0, 0.7, 0.5, 0.35, 0.25],
        "mixed": 0.25,
        "glossy": True,
    },
}

# The same in every scene and part: 8 MiB a probe are 2 to 20 GB on these grids. Maps of 128² are as large as those of the others.
MARCH = ["capture.rays.octahedral.resolution=128", "store.light_field=march(lowest: 8)"]
MARCH += ["store.irradiance.octahedral.resolution=32", "store.occlusion.moments.resolution=32"]
ALWAYS_SCALED = {"mcguire-2017": MARCH}

# What makes our methods shade gloss, in scenes that have it: levels of 32² to 2² texels, which take finer captures.
GLOSS = [
    "capture.rays=octahedral(resolution: 32, per_texel: 1, guided: 0)",
    "store.prefiltered=[32,16,8,4,2]",
    "store.prefilter=ggx",
    "query.glossy=prefiltered(parallax: volume)",
]

# What methods of more than 8 KiB a probe are scaled to where bytes are compared: texels along a side of all their maps.
MAPS = (16, 32, 64)

# On equal positions they have this many. FULL=1: as many as published but where a scene says otherwise, and mcguire-2017 those of
# MARCH; two cores then take four hours more.
QUICK = None if os.environ.get("FULL") else 64


def scaled_maps(preset, texels, glossy=False):
    if preset == "mcguire-2017":
        return [
            f"capture.rays.octahedral.resolution={texels}",
            f"store.light_field=march(lowest: {texels // 8})",
            f"store.irradiance.octahedral.resolution={texels}",
            f"store.occlusion.moments.resolution={texels}",
        ]
    of_preset = {
        # Where bytes are compared, those that gloss would take from irradiance.
        "irradiance-2022": [f"store.prefiltered={[texels >> i for i in range(5)]}"]
        if glossy
        else ["store.prefiltered=[]", "query.glossy=none"],
        "lightfield-2022": [f"store.occlusion.moments.resolution={texels}", "store.layout.published=None"],
    }
    return [
        f"capture.rays.cube.face={2 * texels}",
        f"capture.rays.cube.resolution={texels}",
        f"store.irradiance.octahedral.resolution={texels}",
        *of_preset[preset],
    ]


# Ingredients of the default, each taken away or made another: name, settings.
ABLATION = [
    ("no fit", ["fit=none"]),
    ("a quarter of the rows", ["fit.rows.rows_per_probe=38"]),
    ("2 paths a row, also where it is noisy", ["fit.rows.most_paths=2"]),
    ("no rows with bent normals", ["fit.rows.bent=0"]),
    ("no rows in the air", ["fit.rows.air=0"]),
    ("10 × as firm (lambda)", ["fit.rows.lambda=0.1"]),
    ("no gradients", ["store.irradiance.sh9.gradient=false"]),
    ("maps of 8² texels", ["store.irradiance=octahedral(resolution: 8)"]),
    ("no visibility", ["store.occlusion=none", "query.test=none"]),
    ("8 voxels a cell", ["store.occlusion.surface.voxels_per_cell=8"]),
    ("no floor under sums", ["query.sum_floor=0"]),
    ("captures of 32² rays, guided", ["capture.rays=octahedral(resolution: 32, per_texel: 1, guided: 1.25)"]),
]

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


def typical(configuration, key):
    figure = configuration["figures"][key]
    return figure["mean"] if figure["geometric_mean"] is None else figure["geometric_mean"]


def figure(configuration, key):
    """The same; `None` where a sweep has no such figure, as those of before it was measured."""
    return typical(configuration, key) if key in configuration["figures"] else None


# Ladders


def ladder(scene, part, name, preset, settings, axes=""):
    always = [] if "scaled" in name else ALWAYS_SCALED.get(preset, [])
    quoted = ", ".join(json.dumps(text) for text in [*settings, *always])
    config = config_of(scene)
    config = f'config: "{os.path.relpath(config, WORK / scene / part)}", ' if config else ""
    name += ", scaled" if always else ""
    return f'        (name: "{name}", preset: "{preset}", {config}set: [{quoted}]{axes}),\n'


def at_spacing(spacing):
    return [f"grid.spacing_m={spacing}"]


def positions(scene):
    own = at_spacing(spacing_of(scene))
    glossy, maps = SCENES[scene].get("glossy"), SCENES[scene].get("maps") or QUICK
    entries = []
    for preset in PRESETS:
        if maps and preset in LARGE:
            settings = [*own, *scaled_maps(preset, maps, glossy)]
            entries.append(ladder(scene, "positions", f"{preset}, scaled to {maps}²", preset, settings))
        else:
            entries.append(ladder(scene, "positions", preset, preset, own))
    if glossy:
        entries += [ladder(scene, "positions", f"{name}, with gloss", name, [*own, *GLOSS]) for name in PRESETS[:2]]
    return entries


def curves(scene):
    """Without the large methods, whose ladders would take hours."""
    entries = []
    for preset in (preset for preset in PRESETS if preset not in LARGE):
        values = SCENES[scene].get("curve", [])
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


def rows_of(scene, part):
    report = sweep_of(scene, part)
    if report is None:
        sys.exit(f"{scene}: there is no out/methods/{scene}/{part}/sweep.json; run the part '{part}' first")
    return {row["label"]: row for row in report["configurations"]}


def bytes_(scene):
    """Grids on which every other method has up to twice the bytes that the default has at the scene's own spacing, and those of
    twice that spacing where they have no more."""
    own = spacing_of(scene)
    budget = 2 * typical(rows_of(scene, "positions")["default"], "bytes")
    entries = [ladder(scene, "bytes", "default", "default", at_spacing(own))]
    for preset in (preset for preset in PRESETS if preset != "default"):
        large = [(f"{preset}, scaled to {n}²", scaled_maps(preset, n)) for n in MAPS] if preset in LARGE else []
        for name, settings in large or [(preset, [])]:
            few = ["grid.spacing_m=None", "grid.divisions=(2,2,2)", *settings]
            # A few per cent less than twice: probes come in whole planes.
            probes = 0.97 * budget / probe_bytes(scene, preset, few)
            if probes < 8:
                continue
            if preset == "threev8-mixed":
                grid = at_spacing(fitted_spacing(scene, probes, count(scene, preset, at_spacing(own))))
            else:
                grid = ["grid.spacing_m=None", f"grid.divisions={fitted_divisions(extent(scene), probes)}"]
            entries.append(ladder(scene, "bytes", name, preset, [*settings, *grid]))
            double = at_spacing(2 * own)
            if count(scene, preset, [*settings, *double]) <= probes:
                entries.append(ladder(scene, "bytes", f"{name}, spacing × 2", preset, [*settings, *double]))
    return entries


def probe_bytes(scene, preset, settings):
    words = [word for text in settings for word in ("--set", text)]
    report = json.loads(bake(scene, "--preset", preset, *words, "-o", str(WORK / scene / "few.probes"), "--json"))
    return report["bytes_per_probe"]["runtime_kept"]


def count(scene, preset, settings):
    words = [word for text in settings for word in ("--set", text)]
    return json.loads(bake(scene, "--preset", preset, *words, "--dry-run", "--json"))["probes"]


def offsets(scene):
    """The default and the two published methods that err least there, of the parts `positions` and `bytes`, on shifted grids."""
    entries = [ladder(scene, "offsets", "default", "default", at_spacing(spacing_of(scene)))]
    text = (WORK / scene / "bytes" / "ladder.ron").read_text(encoding="utf-8").splitlines(keepends=True)
    rows = rows_of(scene, "bytes")
    published = [rows[label] for label in rows if label.split(",")[0] not in ("default", "physical")]
    for row in sorted(published, key=lambda row: typical(row, "error_relative"))[:2]:
        entries += [line for line in text if f'name: "{row["label"]}"' in line]
    return entries


def ablation(scene):
    own = at_spacing(spacing_of(scene))
    entries = [ladder(scene, "ablation", "default", "default", own)]
    return entries + [ladder(scene, "ablation", name, "default", [*own, *change]) for name, change in ABLATION]


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
        found = count(scene, "threev8-mixed", at_spacing(spacing))
        off = abs(math.log(found / probes))
        if best is None or off < best[0]:
            best = off, spacing
        if found > probes:
            low = math.log(spacing)
        else:
            high = math.log(spacing)
    return best[1]


PARTS = {
    "positions": positions,
    "bytes": bytes_,
    "offsets": offsets,
    "ablation": ablation,
    "curves": curves,
    "mixed": mixed,
}
WORDS = {"positions": ["--equal", "positions"], "offsets": ["--offsets", "5"], "curves": ["--equal", "bytes"]}


def prepare(scene, part):
    folder = WORK / scene / part
    entries = PARTS[part](scene)
    if not entries:
        return
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "ladder.ron").write_text("(\n    ladders: [\n" + "".join(entries) + "    ],\n)\n", encoding="utf-8")
    (WORK / scene / "machine.txt").write_text(machine(), encoding="utf-8")
    words = [file_of(scene), *SCENES[scene].get("words", [])]
    words += WORDS.get(part, [])
    print("\n".join(words))


def machine():
    try:
        lines = pathlib.Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        lines = []
    return next((line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")), "unknown processor")
