#!/usr/bin/env python3
"""Puts another search path of libraries into a program: rpath.py PROGRAM NEW. The new one must not be longer than the old.

The build's own holds the folder that Embree was linked from, which is of no use elsewhere.
"""
import pathlib
import subprocess
import sys


def main(program, new):
    listed = subprocess.run(["readelf", "-d", program], check=True, capture_output=True, text=True).stdout
    paths = [line.split("[", 1)[1].rstrip("]") for line in listed.splitlines() if "(RPATH)" in line]
    if len(paths) != 1:
        sys.exit(f"error: {program} has {len(paths)} search paths, not one")
    old = paths[0].encode() + b"\0"
    data = pathlib.Path(program).read_bytes()
    if data.count(old) != 1 or len(new) > len(paths[0]):
        sys.exit(f"error: the search path of {program} cannot be replaced: {paths[0]}")
    path = pathlib.Path(program)
    path.write_bytes(data.replace(old, new.encode().ljust(len(old), b"\0")))


if __name__ == "__main__":
    main(*sys.argv[1:])
