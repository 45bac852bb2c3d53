"""The tables of the comparison of all methods, as Markdown."""
import math
import os

from methods_plan import NOTHING, PRESETS, SCENES, WORK, figure, sweep_of, typical


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
    ("bent normals", "error_bent", percent),
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


# Where a scene has glossy surfaces and a row shades them.
GLOSSY = [
    ("gloss: error", "error_gltf", percent),
    ("gloss: relmse", "relmse_gltf", lambda value: "–" if value is None else significant(value)),
    ("gloss: shade", "glossy_shade_ms", milliseconds),
    ("gloss: bytes a probe", "glossy_bytes_per_probe", lambda value: "–" if value is None else f"{value:,.0f}"),
]


def figures_of(report):
    """The columns of a sweep."""
    has_gloss = any(figure(row, "glossy_shade_ms") is not None for row in report["configurations"])
    return FIGURES + GLOSSY if has_gloss else FIGURES


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
    values = [value for value in (figure(row, key) for row in rows) if value is not None]
    return min(values) if len(values) > 1 else None


def full_table(report, held):
    rows = report["configurations"]
    figures = figures_of(report)
    least = {key: best(rows, key) for _, key, _ in figures if key.startswith(("error", "air", "relmse"))}
    head = ["method", "probes", *(name for name, _, _ in figures)]
    own = next((typical(row, "bytes") for row in rows if row["label"] == "default"), None)
    lines = []
    for row in rows:
        cells = [f"`{row['label']}`", f"{row['probes']:,}"]
        for _, key, form in figures:
            value = figure(row, key)
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
    return "\n\n".join(blocks) if blocks else NOTHING


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
                own = [row for row in all_rows if row["label"].split(",")[0] == preset]
                row = min(own, key=lambda row: typical(row, "error_relative"), default=None)
                value = typical(row, "error_relative") if row else None
                text = "–" if value is None else significant(100 * value, 2)
                parts.append(f"**{text}**" if value is not None and value == best(all_rows, "error_relative") else text)
            cells.append(" · ".join(parts))
            first = pair[0]["configurations"]
            row = next((row for row in first if row["label"].split(",")[0] == preset), None)
            for key, ratios in costs.items():
                if row and typical(row, key) is not None:
                    ratios.append(typical(row, key) / typical(first[0], key))
        cells += ["–" if mean is None else f"{significant(mean)} ×" for mean in map(geometric_mean, costs.values())]
        rows.append(cells)
    return markdown(["method", *reports, "bytes a probe", "bake", "shade"], rows)


def mixed_table(scenes):
    """Each grid of `mixed`, and what it has and errs relative to the uniform one."""
    blocks = []
    keys = [("probes", None), ("bytes", "bytes"), ("bake", "bake_s")]
    wanted = ("error_relative", "error_corner", "error_flat", "air_error")
    errors = [(name, key) for name, key, _ in FIGURES if key in wanted]
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
    return "\n\n".join(blocks) if blocks else NOTHING


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
            marked = [f"**{t}**" if e is not None and e == least else t for e, t in zip(errors, texts)]
            # More bytes than any method needs say nothing more.
            if not rows or rows[-1][1:] != marked:
                rows.append([size(budget["bytes"]), *marked])
        head = ["bytes in all", *(f"`{entry['method']}`" for entry in budgets[0]["entries"])]
        blocks.append(f"**{scene}**. {caption(scene, report)}\n\n{markdown(head, rows)}")
    return "\n\n".join(blocks) if blocks else NOTHING
