"""The table of two_rooms.sh: two rooms with 16 probes each, beside what is published."""
import math

from methods_plan import NOTHING, PRESETS, WORK, read_json
from methods_tables import markdown, milliseconds, percent, significant, size

ROOMS = ["two_rooms_sealed", "two_rooms_open"]
# Luo 2022: memory a probe and shading time on an RTX 2070.
PUBLISHED = {"irradiance-2022": ("149.25 KiB", "1.1 ms"), "lightfield-2022": ("576 KiB", "1.1 ms")}
ROOMS_ROWS = ["physical", "physical.walls", *PRESETS[1:]]
VISIBILITY = {"irradiance-2022": "none", "lightfield-2022": "Chebyshev³", "physical": "table at surfaces"}
VISIBILITY["physical.walls"] = "table at surfaces, grid to the walls"
VISIBILITY["default"] = VISIBILITY["physical"]
VISIBILITY |= {"mcguire-2017": "Chebyshev", "ddgi-2019": "Chebyshev³", "threev8-uniform": "Chebyshev", "threev8-mixed": "Chebyshev"}


def room(scene, preset, camera):
    report = read_json(WORK / "rooms" / f"{scene}.{preset}" / camera / "report.json")
    if report is None:
        return None, {}
    methods = {method["name"]: method for method in report["methods"]}
    return report, methods["visibility_on"]


def rooms_row(scene, preset):
    (_, lit), (_, dark), (_, outside) = (room(scene, preset, camera) for camera in ("lit", "dark", "outside"))
    if not (lit and dark and outside):
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
    head = ["method", "visibility", "shading", "published", "a look-up", "memory a probe", "published", "leak.light"]
    head += ["… dark room", "dark room ÷ lit room", "outer faces ÷ lit room", "error"]
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
            cells = [f"`{preset.split('.')[0]}`", VISIBILITY[preset], milliseconds(row["shade"]), time, lookup]
            cells += [size(row["bytes"]), memory]
            cells += [percent(row[key]) for key in ("leak", "leak_dark_room", "dark", "outside", "error")]
            lines.append(cells)
        if lines:
            report, _ = room(scene, "physical", "lit")
            count = report["threads"] if report else 0
            threads = "one thread" if count == 1 else f"{count} threads" if count else "one machine"
            blocks.append(f"**{scene}**, 4 × 2 × 2 probes; times of {threads}.\n\n{markdown(head, lines)}")
    if not blocks:
        return NOTHING
    return "\n\n".join(blocks + ["\n".join(findings(found))])


def findings(found):
    """Whether what was published is seen here."""

    def get(scene, preset, key):
        return (found.get((scene, preset)) or {}).get(key)

    def verdict(holds):
        return "reproduced" if holds else "contradicted"

    without, with_ = (get(ROOMS[0], preset, "dark") for preset in ("irradiance-2022", "lightfield-2022"))
    lines = []
    if without is not None and with_ is not None:
        lines.append(
            f"* No leak with visibility: {verdict(with_ < 0.01 and with_ < without)}. The sealed dark room shows "
            f"{percent(without)} of the lit room's light without visibility and {percent(with_)} with it "
            f"(`physical`: {percent(get(ROOMS[0], 'physical', 'dark'))}); the bound for “no leak” here is 1 %."
        )
    times = [get(scene, preset, "shade") for scene in ROOMS for preset in ("irradiance-2022", "lightfield-2022")]
    if all(times):
        ratio = math.sqrt(times[1] / times[0] * times[3] / times[2])
        lines.append(
            f"* Equal shading time: {verdict(abs(math.log(ratio)) < math.log(1.1))}. Shading with visibility takes "
            f"{significant(ratio)} times as long as without (published: 1.1 ms each); the bound for “equal” is 10 %."
        )
    faces = get(ROOMS[0], "lightfield-2022", "outside")
    if faces is not None:
        lines.append(
            f"* Outer faces lit by interpolation: {verdict(faces > 0.01)}. With visibility the outer faces, which are "
            f"black in truth, show {percent(faces)} of the lit room's light (without: "
            f"{percent(get(ROOMS[0], 'irradiance-2022', 'outside'))}; `physical`: "
            f"{percent(get(ROOMS[0], 'physical', 'outside'))})."
        )
    return lines
