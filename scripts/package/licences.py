#!/usr/bin/env python3
"""Reads `cargo metadata` from standard input and lists what the program is made of, with licences, as Markdown."""
import json
import sys

HEAD = """# What this program is made of

| library | licence |
|---|---|
| Embree 4 (`lib/libembree4*`) | Apache-2.0, see `LICENSE-APACHE` |
| oneTBB (`lib/libtbb*`) | Apache-2.0, see `LICENSE-APACHE` |
| DejaVu Sans, a subset | its own, see `DejaVuSans-LICENSE.txt` |

Rust crates; the text of each licence comes with its source, at `https://crates.io/crates/NAME`:

| crate | version | licence |
|---|---|---|"""


def main():
    metadata = json.load(sys.stdin)
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    packages = {package["id"]: package for package in metadata["packages"]}
    # What is linked, or builds it: all but dependencies of tests.
    waiting, found = [metadata["resolve"]["root"]], set()
    while waiting:
        node = waiting.pop()
        if node in found:
            continue
        found.add(node)
        for dependency in nodes[node]["deps"]:
            if any(kind["kind"] != "dev" for kind in dependency["dep_kinds"]):
                waiting.append(dependency["pkg"])
    print(HEAD)
    for package in sorted((packages[node] for node in found), key=lambda package: package["name"]):
        if package["id"] != metadata["resolve"]["root"]:
            print(f"| {package['name']} | {package['version']} | {package['license'] or 'see its source'} |")


if __name__ == "__main__":
    main()
