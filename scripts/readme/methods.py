#!/usr/bin/env python3
"""The comparison of all methods: what is swept, and the tables made of it. Called by methods.sh and two_rooms.sh.

    scenes                 names of all scenes
    file SCENE             where its file is
    prepare SCENE PART     writes out/methods/SCENE/PART/ladder.ron; prints what else `sweep` needs, a word a line
    show [SCENE]...        prints the tables of these scenes, or of all
    rooms                  prints the table of two_rooms.sh
    publish                puts all tables between their markers and the pictures beside this file
"""
import os
import pathlib
import shutil
import sys

sys.dont_write_bytecode = True

from methods_plan import NOTHING, PARTS, ROOT, SCENES, WORK, file_of, prepare  # noqa: E402
from methods_judged import ablation_table, judged_table, offsets_table  # noqa: E402
from methods_rooms import rooms_table  # noqa: E402
from methods_tables import at_budgets, full_tables, markdown, mixed_table, short_table  # noqa: E402

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
    picture = "\n\n![](../../scripts/readme/methods.png)" if (HERE / "methods.png").is_file() else ""
    return [
        ("short", short_table(scenes) + picture),
        ("positions", full_tables("positions", scenes)),
        ("bytes", full_tables("bytes", scenes)),
        ("judged", judged_table(scenes)),
        ("offsets", offsets_table(scenes)),
        ("ablation", ablation_table(scenes)),
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
        if text == NOTHING:
            print(f"{name}: nothing was run; its table stays as it is", file=sys.stderr)
        else:
            put(ROOT / "configs" / "presets" / "README.md", name, text)


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
