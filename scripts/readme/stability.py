#!/usr/bin/env python3
"""Prints the table of a stability run, ends with one line, and exits 1 when a case does not hold.

--readme writes the shortened table between the markers of tests/README.md, that of the methods to tests/stability;
--check compares the former, digits of figures apart. The table of the methods is always written beside the run's JSON.
"""
import json
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]
README = ROOT / "tests" / "README.md"
METHODS = ROOT / "tests" / "stability" / "README.md"
BEGIN, END = "<!-- stability: begin -->", "<!-- stability: end -->"


def number(value):
    if value is None:
        return "none"
    if value == 0:
        return "0"
    text = f"{value:.2g}" if not 0.01 <= abs(value) < 1000 else f"{value:.3g}"
    return re.sub(r"e([+-])0?(\d)", r"e\1\2", text).replace("e+", "e")


def columns(case):
    figure = number(case["figure"]) + case["unit"] + (f" ({case['note']})" if case["note"] else "")
    bound = f"{case['relation']} {number(case['bound'])}{case['unit']}"
    verdict = "holds" if case["holds"] else "FAILS"
    return [case["group"], case["name"], case["checked"], figure, bound, verdict]


def print_table(rows):
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    for row in rows:
        print("  ".join(cell.ljust(width) for cell, width in zip(row, widths)).rstrip())


def shortened(cases):
    """A row for each group and check: how many cases, the worst figure, the bounds."""
    groups = {}
    for case in cases:
        groups.setdefault((case["group"], case["checked"]), []).append(case)
    lines = ["| extreme | checked | cases | worst figure | bound |", "|---|---|---|---|---|"]
    for (group, checked), members in groups.items():
        least = members[0]["relation"] == "≥"
        figures = [case["figure"] for case in members]
        worst = None if None in figures else (min if least else max)(figures)
        bounds = sorted({case["bound"] for case in members})
        span = number(bounds[0]) + (f" to {number(bounds[-1])}" if len(bounds) > 1 else "")
        unit = members[0]["unit"]
        names = [case["name"] for case in members]
        named = names[0] if len(names) == 1 else f"{len(names)}: {names[0]} … {names[-1]}"
        relation = members[0]["relation"]
        failing = [case["name"] for case in members if not case["holds"]]
        verdict = f", FAILS: {', '.join(failing)}" if failing else ""
        lines.append(f"| {group} | {checked} | {named} | {number(worst)}{unit} | {relation} {span}{unit}{verdict} |")
    return lines


METHODS_HEAD = """# Where the methods' numbers could break

Written by `scripts/stability.sh --readme`; the rows, their bounds and the reasons of these stand in `methods.rs`. Captures are
scaled down for speed, all else is each preset's own: rays through cube faces of 16² texels (`threev8-*`) or of 32² resampled
to 16² (`irradiance-2022`, `lightfield-2022`), maps of 16² texels (`physical`, `path`), 8 paths from every hit (`path`).

`× 10⁻³`, `× 10³`: two rooms of 8 m with a door and a lamp, at that scale against scale 1; the relative difference of the mean
of a picture. At `× 10³` most distances are beyond 255.9 m, whose square is the largest that f16 holds. Every other row is a
closed furnace of emission 1, and the share of its light, πLe/(1 − ρ), that a picture of its wall shows: with 8 probes
at the albedos 0.99 and 0.999; at albedo 1/2 with one probe (one base cell), 1 × 1 × 5 probes, and 4³ probes of which 56 stand
behind the walls and one in a block. Beside each figure how the bake ended. In no run was a value of files, pictures or
reports not finite, and none found more light than there is, but for rounding and the noise of paths.
"""


def methods_table(cases):
    """Markdown: a row for each extreme, a column for each method, and what is by design below."""
    names, extremes, cells, designs = [], [], {}, {}
    for case in cases:
        if case["group"] != "method" or case["checked"].endswith("at least"):
            continue
        method, extreme = case["name"].split(" · ", 1)
        note, _, why = case["note"].partition("; by design: ")
        names += [method] if method not in names else []
        extremes += [extreme] if extreme not in extremes else []
        mark = "" if all(c["holds"] for c in cases if c["name"] == case["name"]) else " **FAILS**"
        cells[extreme, method] = f"{number(case['figure'])}{'*' if why else ''}{mark} ({note})"
        if why and why not in designs.setdefault(method, {}):
            designs[method][why] = []
        if why:
            designs[method][why].append(extreme)
    lines = ["| extreme | " + " | ".join(f"`{name}`" for name in names) + " |", "|---" * (len(names) + 1) + "|"]
    for extreme in extremes:
        lines.append(f"| {extreme} | " + " | ".join(cells.get((extreme, name), "") for name in names) + " |")
    lines += ["", "\\* less than all the light, by design of the method:", ""]
    for method, whys in designs.items():
        lines += [f"* `{method}`, {', '.join(extremes)}: {why}" for why, extremes in whys.items()]
    return METHODS_HEAD + "\n" + "\n".join(lines) + "\n"


def without_figures(lines):
    """All but the worst figures, which differ from machine to machine."""
    return [[cell for i, cell in enumerate(line.split("|")) if i != 4] for line in lines]


def main(path, option=None):
    cases = json.loads(pathlib.Path(path).read_text(encoding="utf-8"))["cases"]
    print_table([["extreme", "case", "checked", "figure", "bound", ""]] + [columns(case) for case in cases])
    holding = sum(case["holds"] for case in cases)
    failed = holding != len(cases)
    methods = methods_table(cases)
    beside = pathlib.Path(path).parent / "stability" / "methods.md"
    beside.parent.mkdir(parents=True, exist_ok=True)
    beside.write_text(methods, encoding="utf-8")
    text = README.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    block, _, after = rest.partition(END)
    if option and not after:
        sys.exit(f"error: {README} has no {BEGIN} … {END}")
    table = shortened(cases)
    if option == "--readme":
        METHODS.write_text(methods, encoding="utf-8")
        README.write_text(before + BEGIN + "\n" + "\n".join(table) + "\n" + END + after, encoding="utf-8")
    if option == "--check" and without_figures(block.strip().splitlines()) != without_figures(table):
        print("tests/README.md: its table of stability is not that of this run; run scripts/stability.sh --readme")
        failed = True
    print(f"stability: {holding} of {len(cases)} cases hold")
    return failed


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
