"""What Fig. 8 of the paper shows, judged from the picture: with more water the colour becomes less saturated and the
highlight weaker.

    trends.py fig8.png      an 8-bit PNG of three cylinders side by side, the driest first; exit status 1 where it is not so
"""
import struct
import sys
import zlib
from pathlib import Path

PER_MM = 4          # pixels, of ../scenes/fig8.yaml
AXES_MM = (-50, 0, 50)
RADIUS_MM = 20
SIDE_MM = -16       # to the left of the axis, at 53 deg: far from the highlight at 10 deg, and lit


def rows_of(path):
    """Rows of (r, g, b) of an 8-bit PNG without interlace."""
    data, at, packed = Path(path).read_bytes(), 8, b""
    while at < len(data):
        size, name = struct.unpack(">I4s", data[at:at + 8])
        if name == b"IHDR":
            width, height, bits, colour = struct.unpack(">IIBB", data[at + 8:at + 18])
            assert (bits, colour) == (8, 2), "an 8-bit RGB picture is expected"
        packed += data[at + 8:at + 8 + size] if name == b"IDAT" else b""
        at += 12 + size
    raw, above = zlib.decompress(packed), bytes(3 * width)
    for y in range(height):
        kind, line = raw[y * (3 * width + 1)], bytearray(raw[y * (3 * width + 1) + 1:(y + 1) * (3 * width + 1)])
        for i in range(3 * width):
            a, b, c = (line[i - 3] if i > 2 else 0), above[i], (above[i - 3] if i > 2 else 0)
            near = min((abs(b - c), 0, a), (abs(a - c), 1, b), (abs(a + b - 2 * c), 2, c))[2]
            line[i] = (line[i] + (0, a, b, (a + b) // 2, near)[kind]) & 255
        above = bytes(line)
        yield [tuple(line[i:i + 3]) for i in range(0, 3 * width, 3)]


def xyz_of(rgb):
    linear = [c / 255 / 12.92 if c <= 10 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in rgb]
    return [sum(m * c for m, c in zip(row, linear)) for row in
            ((.4124, .3576, .1805), (.2126, .7152, .0722), (.0193, .1192, .9505))]  # IEC 61966-2-1


def saturation_of(xyz):
    """Chroma over lightness, CIELAB under D65."""
    fx, fy, fz = (v / n for v, n in zip(xyz, (.9505, 1, 1.089)))
    fx, fy, fz = (t ** (1 / 3) if t > .008856 else 7.787 * t + 16 / 116 for t in (fx, fy, fz))
    return ((500 * (fx - fy)) ** 2 + (200 * (fy - fz)) ** 2) ** 0.5 / (116 * fy - 16)


def main():
    rows = list(rows_of(sys.argv[1]))
    row = rows[len(rows) // 2]
    saturation, highlight = [], []
    for axis in AXES_MM:
        middle = len(row) // 2 + axis * PER_MM
        side = xyz_of(row[middle + SIDE_MM * PER_MM])
        top = max(xyz_of(rgb)[1] for rgb in row[middle - RADIUS_MM * PER_MM:middle + RADIUS_MM * PER_MM])
        saturation.append(saturation_of(side))
        highlight.append(top / side[1])
    falls = [all(a > b for a, b in zip(x, x[1:])) for x in (saturation, highlight)]
    print("saturation " + ", ".join(f"{x:.2f}" for x in saturation) + (": falls" if falls[0] else ": does NOT fall"))
    print("highlight  " + ", ".join(f"{x:.2f}" for x in highlight) + (": weakens" if falls[1] else ": does NOT weaken"))
    return not all(falls)


if __name__ == "__main__":
    sys.exit(main())
