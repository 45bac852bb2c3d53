"""Bakes, exports and renders for exports.sh, and the tables of what came out."""
import json
import math
import os
import pathlib
import subprocess

WORK = pathlib.Path("out/exports")
SHARED = os.environ.get("SHARED", "../shared")
SIZE = os.environ.get("SIZE", "160x90")
SPP = os.environ.get("SPP", "256")
OFFSETS = int(os.environ.get("OFFSETS", "5"))

SCENES = {
    "two_rooms_sealed": {"file": "scenes/two_rooms_sealed.glb", "spacing": 1.0, "cameras": ["lit", "dark"]},
    "two_rooms_open": {"file": "scenes/two_rooms_open.glb", "spacing": 1.0, "cameras": ["lit", "dark"]},
    "veach_ajar": {"file": f"{SHARED}/scenes/veach_ajar/veach_ajar.glb", "spacing": 0.7, "cameras": [None]},
    "bathroom": {
        "file": f"{SHARED}/scenes/bathroom/LAZIENKA.gltf",
        "spacing": 0.35,
        "cameras": [None],
        "words": ["--env", "1,1,1"],
    },
}
ENGINES = {"three": "three", "bevy": "Bevy"}
WAYS = {"one": [], "one.fit": ["--fit"], "auto": ["--volumes", "auto"], "auto.fit": ["--volumes", "auto", "--fit"]}

# Shares of a cell by which grids are shifted: a sequence that fills the cell evenly (powers of 1/1.2207, the root of
# x^4 = x + 1), from the scene's own grid.
STEPS = [0.8191725134, 0.6710436067, 0.5497004779]


def shifts():
    return [[(k * step) % 1.0 for step in STEPS] for k in range(OFFSETS)]


def run(*words):
    """What a command says, as JSON."""
    threads = ["--threads", os.environ["THREADS"]] if "THREADS" in os.environ and words[0] != "inspect" else []
    command = [os.environ["LIGHTPROBE"], *words, *threads, "--json", *([] if words[0] == "inspect" else ["-q"])]
    result = subprocess.run(command, check=True, stdout=subprocess.PIPE, encoding="utf-8")
    return json.loads(result.stdout)


def kept(path, make):
    """What lies there, or what `make` returns, which is put there once it is whole."""
    if path.is_file():
        return json.loads(path.read_text(encoding="utf-8"))
    path.parent.mkdir(parents=True, exist_ok=True)
    found = make()
    whole = path.with_suffix(".part")
    whole.write_text(json.dumps(found), encoding="utf-8")
    whole.rename(path)
    return found


def bake(scene, folder, shift):
    own = SCENES[scene]
    words = ["bake", own["file"], *own.get("words", []), "-o", str(folder / "probes"), "--set",
             f"grid.spacing_m={own['spacing']}"]
    if any(shift):
        # The scene's own grid, moved, with a plane more on the side that it left.
        grid = run("inspect", str(WORK / scene / "0" / "probes"))["grid"]
        # What follows from a spacing is rounded up.
        inset = 1e-5 * own["spacing"]
        low = [o + (s - 1 if s > 0 else 0) * d + inset for o, s, d in zip(grid["origin"], shift, grid["spacing"])]
        high = [o + (n - 1 + s) * d - inset
                for o, n, s, d in zip(grid["origin"], grid["divisions"], shift, grid["spacing"])]
        text = [", ".join(f"{x:.9f}" for x in corner) for corner in (low, high)]
        words += ["--set", f"grid.bounds=(min: ({text[0]}), max: ({text[1]}))"]
    return run(*words)


def view(camera):
    return ["--size", SIZE, *(["--camera", camera] if camera else [])]


def reference(scene, camera):
    own = SCENES[scene]
    file = WORK / scene / f"reference.{camera or 'own'}.exr"
    if not file.is_file():
        file.parent.mkdir(parents=True, exist_ok=True)
        part = file.with_suffix(".part.exr")
        run("reference", own["file"], *own.get("words", []), "-o", str(part), "--spp", SPP, *view(camera))
        part.rename(file)
    return str(file)


def render(scene, camera, probes, folder):
    own = SCENES[scene]
    against = ["--reference-image", reference(scene, camera)]
    return run("render", own["file"], *own.get("words", []), str(probes), "-o", str(folder), *view(camera), *against)


def measure(scene):
    """Of each shift: the bake's own picture and each export, by camera."""
    own, found = SCENES[scene], []
    for number, shift in enumerate(shifts()):
        base = WORK / scene / str(number)
        kept(base / "bake.json", lambda: bake(scene, base, shift))
        of_shift = {}
        for camera in own["cameras"]:
            name = camera or "own"
            of_shift["own", "own", name] = kept(
                base / f"own.{name}.json", lambda: render(scene, camera, base / "probes", base / f"own.{name}"))
        for engine in ENGINES:
            for way, words in WAYS.items():
                folder = base / f"{engine}.{way}"
                export = ["export", str(base / "probes"), "--to", engine, "-o", str(folder), "--scene", own["file"]]
                env = own.get("words", [])
                made = kept(base / f"{engine}.{way}.json", lambda: run(*export, *env, *words))
                of_shift[engine, way] = made
                for camera in own["cameras"]:
                    name = camera or "own"
                    of_shift[engine, way, name] = kept(
                        base / f"{engine}.{way}.{name}.json",
                        lambda: render(scene, camera, folder, base / f"{engine}.{way}.{name}"))
        found.append(of_shift)
    return found


def on(report):
    return next(method for method in report["methods"] if method["name"] == "visibility_on")


def error(report):
    figures = on(report)["error"] or on(report)["error_gltf"]
    return figures["nrmse"]


def typical(values):
    known = [value for value in values if value]
    return math.exp(sum(map(math.log, known)) / len(known)) if known else None


def number(value, digits=2):
    return "–" if value is None else f"{value:.{digits}g}" if value < 100 else f"{value:.0f}"


def percent(value, digits=2):
    return "–" if value is None else "0" if value == 0 else f"{100 * value:.{digits}g} %"


def ways(cell):
    return " | ".join(cell(way) for way in WAYS)


def table(title, rows):
    print(f"\n{title}\n\n| scene, camera | engine | one volume | one, fitted | auto | auto, fitted |\n|---|---|---|---|---|---|")
    for row in rows:
        print(f"| {' | '.join(row)} |")


def each(found):
    for scene, shifts_of in found.items():
        for camera in SCENES[scene]["cameras"]:
            for engine, name in ENGINES.items():
                of = {way: [s[engine, way, camera or "own"] for s in shifts_of] for way in WAYS}
                yield scene, camera, engine, name, of


def show(found):
    labels = lambda scene, camera, name: (f"{scene}{', ' + camera if camera else ''}", name)
    rows = []
    for scene, camera, engine, name, of in each(found):
        if scene == "two_rooms_sealed" and camera == "dark":
            continue
        errors = {way: [error(report) for report in reports] for way, reports in of.items()}
        own = typical(error(s["own", "own", camera or "own"]) for s in found[scene])
        cells = []
        for way in WAYS:
            text = number(typical(errors[way]))
            if way.endswith(".fit"):
                unfitted = errors[way.removesuffix(".fit")]
                text += f" (× {number(max(a / b for a, b in zip(errors[way], unfitted)))} at most)"
            cells.append(text)
        rows.append((*labels(scene, camera, name), *cells))
        if engine == "three":
            rows[-1] = (f"{rows[-1][0]} (own look-up {number(own)})", *rows[-1][1:])
    table("Error of indirect irradiance (nrmse), geometric mean over the grids; fitted ÷ unfitted of the worst grid:", rows)

    rows = []
    for engine, name in ENGINES.items():
        cells = []
        for way in WAYS:
            mean = lambda s, camera: on(s[engine, way, camera])["irradiance_indirect_mean"]
            shares = [mean(s, "dark") / mean(s, "lit") for s in found.get("two_rooms_sealed", [])]
            cells.append(f"{percent(min(shares))} to {percent(max(shares))}" if shares and max(shares) else percent(0))
        rows.append(("two_rooms_sealed", name, *cells))
    table("Light in the sealed dark room ÷ in the lit one, least and most over the grids:", rows)

    rows, blacks = [], []
    for scene, camera, engine, name, of in each(found):
        dark = {way: [on(report)["leak"]["dark_region"] for report in reports] for way, reports in of.items()}
        if any(value is not None for value in dark["one"]):
            rows.append((*labels(scene, camera, name), *(percent(max(v or 0 for v in dark[way])) for way in WAYS)))
        black = {way: [on(report)["leak"].get("black") for report in reports] for way, reports in of.items()}
        if any(value is not None for value in black["one"]):
            blacks.append((*labels(scene, camera, name), *(percent(max(v or 0 for v in black[way])) for way in WAYS)))
    table("Light where the reference is dark ÷ its mean, most over the grids:", rows)
    table("Falsely black pixels (`leak.black`), most over the grids:", blacks)

    rows, sizes = [], []
    for scene, shifts_of in found.items():
        for engine, name in ENGINES.items():
            cells = []
            for way in WAYS:
                fits = [s[engine, f"{way.removesuffix('.fit')}.fit"]["fit"] for s in shifts_of]
                key = "air_after" if way.endswith(".fit") else "air_before"
                text = number(typical(fit[key] for fit in fits))
                if way.endswith(".fit"):
                    text += f" (× {number(max(fit['air_after'] / fit['air_before'] for fit in fits))} at most)"
                cells.append(text)
            rows.append((scene, name, *cells))
            made = {way: [s[engine, way] for s in shifts_of] for way in WAYS}
            size = lambda way: f"{made[way][0]['volumes']} of {made[way][0]['probes']}, {made[way][0]['bytes'] / 1024:.0f} KiB"
            sizes.append((scene, name, *(size(way) for way in WAYS)))
    table("Error in the air (nrmse), geometric mean over the grids; fitted ÷ unfitted of the worst grid:", rows)
    table("Volumes, their probes and bytes, of the scene's own grid:", sizes)


def album(found):
    """For tests/engines: which pictures of the first grid the engines are to make too."""
    entries = []
    for scene, camera, engine, _, of in each(found):
        for way in WAYS:
            base, name = WORK / scene / "0", camera or "own"
            entries.append({
                "engine": engine,
                "scene": SCENES[scene]["file"],
                "export": str(base / f"{engine}.{way}"),
                "rendered": str(base / f"{engine}.{way}.{name}"),
                "camera": of[way][0]["camera"],
                "name": f"{scene}.{name}.{engine}.{way}",
            })
    (WORK / "album.json").write_text(json.dumps(entries, indent=1), encoding="utf-8")


def main():
    names = os.environ.get("SCENES", " ".join(SCENES)).split()
    found = {}
    for scene in names:
        if pathlib.Path(SCENES[scene]["file"]).is_file():
            found[scene] = measure(scene)
        else:
            print(f"{SCENES[scene]['file']} is not there: {scene} is left out")
    show(found)
    album(found)


if __name__ == "__main__":
    main()
