#!/usr/bin/env bash
# FLIP, RMSE and PSNR of diff-report against other people's programs.

# shellcheck source=scripts/lib.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

only_help "usage: scripts/check_metrics.sh

Makes five pairs of pictures, compares each with diff-report, with NVIDIA's flip-evaluator (from PyPI, into a virtual
environment in out/) and with OpenImageIO's idiff (Debian: openimageio-tools), and prints the largest deviations. Exits with 1
where FLIP is off by more than 2e-4, or RMSE or PSNR by more than the digits that idiff prints.
LIGHTPROBE names a binary to use instead of building one." "$@"

type -P idiff >/dev/null || die "idiff is missing: install openimageio-tools"
provide_lightprobe

folder=out/metrics
python=out/venv/bin/python
[[ -x $python ]] || python3 -m venv out/venv
"$python" -c 'import flip_evaluator, numpy, PIL' 2>/dev/null ||
    out/venv/bin/pip -q install --disable-pip-version-check numpy pillow flip-evaluator
rm -rf -- "$folder"
mkdir -p "$folder"

"$python" - "$lightprobe" "$folder" <<'PYTHON'
import json
import re
import subprocess
import sys

import flip_evaluator
import numpy as np
from PIL import Image

program, folder = sys.argv[1:]
random = np.random.default_rng(1)
height, width = 180, 320
y, x = np.mgrid[0:height, 0:width]
smooth = np.stack([x / width, y / height, 0.5 + 0.4 * np.sin(x / 9.0) * np.cos(y / 13.0)], -1)
checks = np.repeat((((x // 20) + (y // 20)) % 2)[..., None] * 0.8 + 0.1, 3, -1)
pairs = {
    "noise": (smooth, smooth + random.normal(0, 0.05, smooth.shape)),
    "brighter": (smooth, smooth * 1.02),
    "shifted": (checks, np.roll(checks, 1, 1)),
    "hue": (smooth, smooth[..., ::-1]),
    "spots": (checks, np.where(random.random(checks.shape[:2])[..., None] < 0.003, 1.0, checks)),
}


def save(name, pixels):
    path = f"{folder}/{name}.png"
    Image.fromarray((np.clip(pixels, 0, 1) * 255 + 0.5).astype(np.uint8)).save(path)
    return path


worst = {"flip": 0.0, "rmse": 0.0, "psnr": 0.0}
print(f"{'pair':<10}{'FLIP':>10}{'theirs':>10}{'RMSE':>10}{'idiff':>10}{'PSNR':>8}{'idiff':>8}")
for name, (a, b) in pairs.items():
    a, b = save(f"{name}_a", a), save(f"{name}_b", b)
    run = subprocess.run([program, "diff-report", a, b, "-o", f"{folder}/{name}", "--json"], capture_output=True, text=True)
    image = json.loads(run.stdout)["images"][0]
    _, flip, _ = flip_evaluator.evaluate(a, b, "LDR")
    # idiff prints nothing about pictures within its thresholds.
    text = subprocess.run(["idiff", "-v", "-a", "-fail", "0", "-warn", "0", a, b], capture_output=True, text=True).stdout
    number = lambda label: float(re.search(label + r"\s*=\s*([-0-9.e+]+)", text).group(1))
    rmse, psnr = number("RMS error"), number("Peak SNR")
    print(f"{name:<10}{image['flip']['mean']:>10.5f}{flip:>10.5f}{image['rmse']:>10.6f}{rmse:>10.6f}{image['psnr_db']:>8.3f}{psnr:>8.3f}")
    worst["flip"] = max(worst["flip"], abs(image["flip"]["mean"] - flip))
    worst["rmse"] = max(worst["rmse"], abs(image["rmse"] / rmse - 1))
    worst["psnr"] = max(worst["psnr"], abs(image["psnr_db"] / psnr - 1))
print(f"largest deviations: FLIP {worst['flip']:.2e}, RMSE {worst['rmse']:.2e} relative, PSNR {worst['psnr']:.2e} relative")
# idiff prints six digits.
sys.exit(worst["flip"] > 2e-4 or worst["rmse"] > 1e-5 or worst["psnr"] > 1e-5)
PYTHON
