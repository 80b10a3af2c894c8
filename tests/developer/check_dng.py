# SPDX-License-Identifier: Apache-2.0
"""Opens the DNG files of nights in LibRaw's dcraw_emu and compares them with the PNG beside them.

  python3 tests/developer/check_dng.py FOLDER...

FOLDER holds what `npsim night --camera automotive-raw --raw` wrote. Fails where a file does not open, has another size,
or another colour: r/g and b/g of the pixels that neither saturate nor drown in noise, within 10 %. Does nothing without
dcraw_emu (Debian: libraw-bin) or Pillow.
"""
import glob
import os
import shutil
import subprocess
import sys
import tempfile

try:
    import numpy
    from PIL import Image
except ImportError:
    print("skipped: needs numpy and Pillow")
    sys.exit(0)
if not shutil.which("dcraw_emu"):
    print("skipped: needs dcraw_emu")
    sys.exit(0)


def colour(linear):
    brightest = linear.max(axis=2)
    mean = linear[(brightest > 0.02) & (brightest < 0.5)].mean(axis=0)
    return mean[0] / mean[1], mean[2] / mean[1]


failed = 0
for folder in sys.argv[1:]:
    for dng in sorted(glob.glob(os.path.join(folder, "*.dng"))):
        with tempfile.TemporaryDirectory() as place:
            copy = shutil.copy(dng, place)
            # White balance of the camera, sRGB primaries, linear 8 bits, no automatic brightness, TIFF.
            subprocess.run(["dcraw_emu", "-w", "-o", "1", "-g", "1", "1", "-W", "-T", copy], check=True)
            developed = numpy.asarray(Image.open(copy + ".tiff")).astype(float) / 255
        shown = numpy.asarray(Image.open(dng[:-4] + ".png")).astype(float) / 255
        shown = numpy.where(shown <= 0.04045, shown / 12.92, ((shown + 0.055) / 1.055) ** 2.4)
        same = developed.shape == shown.shape
        ratios = [a / b for a, b in zip(colour(developed), colour(shown))] if same else []
        good = same and all(0.9 < r < 1.1 for r in ratios)
        failed += not good
        print(dng, developed.shape, ["%.3f" % r for r in ratios], "good" if good else "BAD")
sys.exit(1 if failed else 0)
