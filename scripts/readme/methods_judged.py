"""Tables that judge the default: against all others at twice its bytes and on equal positions, on shifted grids, and without
each of its ingredients."""
from methods_plan import NOTHING, figure, sweep_of, typical
from methods_tables import geometric_mean, markdown, percent, significant, size

OURS = ("default", "physical")
# The default's row that shades gloss.
GLOSSY = "default, with gloss"


def split(report):
    """The default's row and those of published methods."""
    rows = report["configurations"]
    own = next(row for row in rows if row["label"] == "default")
    return own, [row for row in rows if row["label"].split(",")[0] not in OURS]


def least(rows, key):
    rows = [row for row in rows if figure(row, key) is not None]
    return min(rows, key=lambda row: typical(row, key)) if rows else None


def ratio(own, other, key):
    if other is None:
        return None
    a, b = figure(own, key), figure(other, key)
    return a / b if a is not None and b else None


def times(value):
    return "–" if value is None else f"{significant(value, 2)} ×"


JUDGED = [
    ("error", "bytes", "error_relative"),
    ("corners", "bytes", "error_corner"),
    ("bent normals", "bytes", "error_bent"),
    ("in air", "bytes", "air_error"),
    ("error, equal positions", "positions", "error_relative"),
    ("corners", "positions", "error_corner"),
    ("bent normals", "positions", "error_bent"),
    ("in air", "positions", "air_error"),
]


def judged_table(scenes):
    """What the default errs, and that as a share of what the best published method does: each figure's best."""
    lines, columns = [], [[] for _ in JUDGED]
    leaks, gloss = [], []
    for scene in scenes:
        reports = {part: sweep_of(scene, part) for part in ("bytes", "positions")}
        if None in reports.values():
            continue
        own, published = split(reports["bytes"])
        best = least(published, "error_relative")
        cells = [scene, size(typical(own, "bytes")), percent(typical(own, "error_relative"))]
        cells += [f"`{best['label']}`", size(typical(best, "bytes")), percent(typical(best, "error_relative"))]
        for column, (_, part, key) in zip(columns, JUDGED):
            own, published = split(reports[part])
            value = ratio(own, least(published, key), key)
            column.append(value)
            cells.append(times(value))
        own, published = split(reports["positions"])
        ddgi = next((row for row in published if row["label"].split(",")[0] == "ddgi-2019"), None)
        leaks.append(ratio(own, ddgi, "leak_light"))
        cells.append(times(leaks[-1]))
        with_gloss = next((row for row in reports["positions"]["configurations"] if row["label"] == GLOSSY), own)
        gloss.append(ratio(with_gloss, least(published, "relmse_gltf"), "relmse_gltf"))
        cells.append(times(gloss[-1]))
        lines.append(cells)
    if not lines:
        return NOTHING
    means = [times(geometric_mean(column)) for column in [*columns, leaks, gloss]]
    lines.append(["geometric mean", "", "", "", "", "", *means])
    head = ["scene", "bytes", "error", "best published at twice the bytes", "bytes", "error"]
    head += [f"{name} ÷ best" for name, *_ in JUDGED] + ["leak light ÷ `ddgi-2019`'s", "relmse of gloss, equal positions ÷ best"]
    return markdown(head, lines)


def offsets_table(scenes):
    """Geometric means over shifted grids, and the range of the error."""
    lines = []
    for scene in scenes:
        report = sweep_of(scene, "offsets")
        if report is None:
            continue
        for row in report["configurations"]:
            figure = row["figures"]["error_relative"]
            span = f"{percent(figure['min'])} to {percent(figure['max'])}"
            cells = [scene if row is report["configurations"][0] else "", f"`{row['label']}`", size(typical(row, "bytes"))]
            lines.append([*cells, percent(typical(row, "error_relative")), span, percent(typical(row, "leak_light"))])
    head = ["scene", "method", "bytes", "error, geometric mean", "from to", "leak light"]
    return markdown(head, lines) if lines else NOTHING


ABLATED = [
    ("error", "error_relative"),
    ("corners", "error_corner"),
    ("bent normals", "error_bent"),
    ("in air", "air_error"),
    ("leak light", "leak_light"),
    ("leak dark", "leak_dark"),
    ("bytes", "bytes"),
    ("bake", "bake_s"),
]


def ablation_table(scenes):
    """Geometric means over scenes of what each change makes of the default's figures; in brackets the least and the most of the
    error."""
    reports = [report for report in (sweep_of(scene, "ablation") for scene in scenes) if report]
    lines = []
    for label in [row["label"] for row in reports[0]["configurations"][1:]] if reports else []:
        rows = [{row["label"]: row for row in report["configurations"]} for report in reports]
        cells = [label]
        for _, key in ABLATED:
            ratios = [ratio(row[label], row["default"], key) for row in rows]
            ratios = [value for value in ratios if value]
            text = times(geometric_mean(ratios))
            if key == "error_relative":
                text += f" ({significant(min(ratios), 2)} to {significant(max(ratios), 2)})"
            cells.append(text)
        black = [typical(row[label], "air_black") for row in rows]
        cells.append(percent(sum(black) / len(black)))
        lines.append(cells)
    head = ["change", *(name for name, _ in ABLATED), "black in air"]
    return markdown(head, lines) if lines else NOTHING
