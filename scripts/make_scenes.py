#!/usr/bin/env python3
"""Writes the scenes of lightprobe as GLB files, the same bytes on every machine.

    python3 scripts/make_scenes.py [NAME ...] [--out DIR] [--list]

`courtyard` has a sun and no sky: give it one with `--env`, for instance `--env 0.35,0.5,0.8`.
"""

import argparse
import sys
from pathlib import Path

sys.dont_write_bytecode = True  # no __pycache__ in the repository

from scenes import check, classics, courtyard, office, rooms  # noqa: E402 (after the line above)

SCENES = {
    "two_rooms_sealed": rooms.two_rooms_sealed,
    "two_rooms_open": rooms.two_rooms_open,
    "two_rooms_ball": rooms.two_rooms_ball,
    "cornell": classics.cornell,
    "furnace": classics.furnace,
    "thin_wall": rooms.thin_wall,
    "courtyard": courtyard.courtyard,
    "office": office.office,
    "glossy_room": classics.glossy_room,
}


def row(name, figures):
    """A scene's figures on a few lines."""
    triangles = f"{figures['triangles']} triangles"
    if figures["stored"] != figures["triangles"]:
        triangles += f" ({figures['stored']} stored, {figures['objects']} objects)"
    lights = "".join(f", {light}" for light in figures["lights"])
    return "\n".join(
        [
            f"{name}.glb  {figures['bytes']} bytes, {triangles}",
            f"    bounds   {figures['low']} to {figures['high']} m",
            f"    parts    {figures['solids']} solids, {figures['sheets']} sheets, {figures['inward']} facing in",
            f"    cameras  {', '.join(figures['cameras'])}",
            f"    lights   {figures['emitters']} emitting triangles{lights}",
        ]
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help="scenes to write (default: all)")
    parser.add_argument(
        "--out",
        type=Path,
        metavar="DIR",
        default=Path(__file__).resolve().parent.parent / "scenes",
        help="folder to write to (default: the repository's scenes/)",
    )
    parser.add_argument("--list", action="store_true", help="print the figures of each scene and write nothing")
    arguments = parser.parse_args()
    unknown = [name for name in arguments.names if name not in SCENES]
    if unknown:
        parser.error(f"no scene {', '.join(unknown)}; there are {', '.join(SCENES)}")

    for name in arguments.names or SCENES:
        glb = SCENES[name]().to_bytes()
        try:
            figures = check.measure(glb)
        except check.Broken as broken:
            sys.exit(f"{name}: does not hold: {broken}")
        if not arguments.list:
            arguments.out.mkdir(parents=True, exist_ok=True)
            (arguments.out / f"{name}.glb").write_bytes(glb)
        print(row(name, figures))


if __name__ == "__main__":
    main()
