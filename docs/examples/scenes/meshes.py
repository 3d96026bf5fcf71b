"""Writes the meshes of mesh.yaml, surfaces of our own: bowl.obj, glazed inside and out, and knot.ply.

    python3 docs/examples/scenes/meshes.py FOLDER
"""
import math
import struct
import sys
from pathlib import Path

AROUND = 48

# Profile of the bowl, from the foot over the rim to the middle inside: radius, height in mm; True: glazed outside.
PROFILE = [(0, 0, True), (9, 0, True), (9.6, 0.4, True), (9.2, 2, True), (14, 4.5, True), (19, 9, True), (22.5, 14.5, True),
           (24, 20, True), (23.6, 20.6, True), (22.9, 20.2, False), (21.4, 14.8, False), (18, 9.9, False), (13.4, 5.9, False),
           (7, 3.8, False), (0, 3.2, False)]


def bowl():
    """A surface of revolution about y; smooth but at the rim and the foot, by normals of its profile."""
    lines = ["# a bowl, written by meshes.py"]
    for radius, height, _ in PROFILE:
        for k in range(AROUND):
            phi = 2 * math.pi * k / AROUND
            lines.append(f"v {radius * math.sin(phi):.3f} {height:.3f} {radius * math.cos(phi):.3f}")
    for i in range(len(PROFILE)):
        (r0, y0, _), (r1, y1, _) = PROFILE[max(i - 1, 0)], PROFILE[min(i + 1, len(PROFILE) - 1)]
        length = math.hypot(r1 - r0, y1 - y0)
        for k in range(AROUND):
            phi, along, up = 2 * math.pi * k / AROUND, (y1 - y0) / length, (r0 - r1) / length
            lines.append(f"vn {along * math.sin(phi):.4f} {up:.4f} {along * math.cos(phi):.4f}")
    for i in range(len(PROFILE) - 1):
        if i == 0 or PROFILE[i][2] != PROFILE[i - 1][2]:
            lines.append(f"usemtl {'outside' if PROFILE[i][2] else 'inside'}")
        for k in range(AROUND):
            a, b = i * AROUND + k + 1, i * AROUND + (k + 1) % AROUND + 1
            lines.append("f " + " ".join(f"{v}//{v}" for v in (a, b, b + AROUND, a + AROUND)))
    return "\n".join(lines) + "\n"


def knot_point(t):
    """The trefoil."""
    return (math.sin(t) + 2 * math.sin(2 * t), math.cos(t) - 2 * math.cos(2 * t), -math.sin(3 * t))


def unit(v):
    length = math.sqrt(sum(x * x for x in v))
    return tuple(x / length for x in v)


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def knot(steps=96, sides=14, radius=0.55):
    """A tube around the trefoil, with normals."""
    vertices, faces = [], []
    for i in range(steps):
        t = 2 * math.pi * i / steps
        p, q = knot_point(t - 1e-4), knot_point(t + 1e-4)
        along = unit(tuple(y - x for x, y in zip(p, q)))
        side = unit(cross(along, (0, 0, 1)))
        up = cross(side, along)
        for k in range(sides):
            phi = 2 * math.pi * k / sides
            normal = tuple(math.cos(phi) * s + math.sin(phi) * u for s, u in zip(side, up))
            vertices.append(tuple(c + radius * n for c, n in zip(knot_point(t), normal)) + normal)
            a, b = i * sides + k, i * sides + (k + 1) % sides
            c, d = ((i + 1) % steps) * sides + (k + 1) % sides, ((i + 1) % steps) * sides + k
            faces.append((a, d, c, b))
    header = ("ply\nformat binary_little_endian 1.0\ncomment a trefoil, written by meshes.py\n"
              f"element vertex {len(vertices)}\n" + "".join(f"property float {n}\n" for n in "x y z nx ny nz".split()) +
              f"element face {len(faces)}\nproperty list uchar ushort vertex_indices\nend_header\n")
    body = b"".join(struct.pack("<6f", *(round(x, 4) for x in v)) for v in vertices)
    return header.encode() + body + b"".join(struct.pack("<B4H", 4, *f) for f in faces)


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    (folder / "bowl.obj").write_text(bowl())
    (folder / "knot.ply").write_bytes(knot())
