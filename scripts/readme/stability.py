#!/usr/bin/env python3
"""Prints the table of a stability run, ends with one line, and exits 1 when a case does not hold.

--readme writes the shortened table between the README's markers; --check compares it, digits of figures apart.
"""
import json
import pathlib
import re
import sys

README = pathlib.Path(__file__).resolve().parents[2] / "README.md"
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


def without_figures(lines):
    """All but the worst figures, which differ from machine to machine."""
    return [[cell for i, cell in enumerate(line.split("|")) if i != 4] for line in lines]


def main(path, option=None):
    cases = json.loads(pathlib.Path(path).read_text(encoding="utf-8"))["cases"]
    print_table([["extreme", "case", "checked", "figure", "bound", ""]] + [columns(case) for case in cases])
    holding = sum(case["holds"] for case in cases)
    failed = holding != len(cases)
    text = README.read_text(encoding="utf-8")
    before, _, rest = text.partition(BEGIN)
    block, _, after = rest.partition(END)
    if option and not after:
        sys.exit(f"error: {README.name} has no {BEGIN} … {END}")
    table = shortened(cases)
    if option == "--readme":
        README.write_text(before + BEGIN + "\n" + "\n".join(table) + "\n" + END + after, encoding="utf-8")
    if option == "--check" and without_figures(block.strip().splitlines()) != without_figures(table):
        print("README.md: its table of stability is not that of this run; run scripts/stability.sh --readme")
        failed = True
    print(f"stability: {holding} of {len(cases)} cases hold")
    return failed


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
