#!/usr/bin/env python3
"""Makes a wheel of an unpacked archive: wheel.py ARCHIVE VERSION PLATFORM FOLDER. Prints the wheel's path.

It holds no Python: the program goes to the environment's bin folder, Embree and TBB to its lib folder, where the program looks.
"""
import base64
import hashlib
import pathlib
import sys
import zipfile

METADATA = """Metadata-Version: 2.1
Name: lightprobe
Version: {version}
Summary: Bakes light-field probe volumes for global illumination and measures how much they leak, err and cost
License: MIT OR Apache-2.0
Requires-Python: >=3.8
Description-Content-Type: text/markdown

{readme}"""

WHEEL = """Wheel-Version: 1.0
Generator: lightprobe
Root-Is-Purelib: false
Tag: py3-none-{platform}
"""

MODE_PROGRAM, MODE_FILE = 0o100755, 0o100644


def main(archive, version, platform, folder):
    archive = pathlib.Path(archive)
    info, data = f"lightprobe-{version}.dist-info", f"lightprobe-{version}.data"
    readme = (archive / "README.md").read_text(encoding="utf-8")
    files = [(f"{data}/scripts/lightprobe", (archive / "bin/lightprobe").read_bytes(), MODE_PROGRAM)]
    files += [(f"{data}/data/lib/{path.name}", path.read_bytes(), MODE_PROGRAM) for path in sorted((archive / "lib").iterdir())]
    licences = [archive / "LICENSE-MIT", archive / "LICENSE-APACHE", *sorted((archive / "licences").iterdir())]
    files += [(f"{info}/licenses/{path.name}", path.read_bytes(), MODE_FILE) for path in licences]
    files += [
        (f"{info}/METADATA", METADATA.format(version=version, readme=readme).encode(), MODE_FILE),
        (f"{info}/WHEEL", WHEEL.format(platform=platform).encode(), MODE_FILE),
    ]
    record = []
    for name, content, _ in files:
        digest = base64.urlsafe_b64encode(hashlib.sha256(content).digest()).rstrip(b"=").decode()
        record.append(f"{name},sha256={digest},{len(content)}\n")
    record.append(f"{info}/RECORD,,\n")
    files.append((f"{info}/RECORD", "".join(record).encode(), MODE_FILE))
    wheel = pathlib.Path(folder) / f"lightprobe-{version}-py3-none-{platform}.whl"
    with zipfile.ZipFile(wheel, "w", zipfile.ZIP_DEFLATED) as container:
        for name, content, mode in files:
            # One date for all, so that the same content gives the same wheel.
            entry = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            entry.external_attr, entry.compress_type = mode << 16, zipfile.ZIP_DEFLATED
            container.writestr(entry, content)
    print(wheel)


if __name__ == "__main__":
    main(*sys.argv[1:])
