"""Meshes of the scenes, all of formulas: shells as PLY with normals, tetrahedra as legacy VTK. Lengths in mm."""
import numpy as np


def write_shell(path, vertices, triangles, normals, **properties):
    """`properties`: further numbers at each vertex."""
    rows = np.column_stack([vertices, normals, *properties.values()])
    header = ["ply", "format binary_little_endian 1.0", "comment units mm", f"element vertex {len(rows)}"]
    header += [f"property double {name}" for name in ("x", "y", "z", "nx", "ny", "nz", *properties)]
    header += [f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header\n"]
    faces = np.zeros(len(triangles), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    faces["count"], faces["corners"] = 3, triangles
    with open(path, "wb") as file:
        file.write("\n".join(header).encode() + rows.astype("<f8").tobytes() + faces.tobytes())


def write_tetrahedra(path, vertices, tetrahedra):
    """Tetrahedra whose volume would be negative are turned."""
    vertices, tetrahedra = np.asarray(vertices, float), np.array(tetrahedra)
    sides = vertices[tetrahedra[:, 1:]] - vertices[tetrahedra[:, :1]]
    negative = np.linalg.det(sides) < 0
    tetrahedra[negative] = tetrahedra[negative][:, [0, 2, 1, 3]]
    with open(path, "w", encoding="ascii") as file:
        file.write(f"# vtk DataFile Version 3.0\ntetrahedra\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {len(vertices)} double\n")
        file.writelines("%.15g %.15g %.15g\n" % tuple(point) for point in vertices)
        file.write(f"CELLS {len(tetrahedra)} {5 * len(tetrahedra)}\n")
        file.writelines("4 %d %d %d %d\n" % tuple(corners) for corners in tetrahedra)
        file.write(f"CELL_TYPES {len(tetrahedra)}\n" + "10\n" * len(tetrahedra))


def disc(rings):
    """The unit disc in rings of 6, 12, 18 … points: 6 rings^2 triangles. @return points (x, y), triangles"""
    points, first = [(0.0, 0.0)], [0]
    for ring in range(1, rings + 1):
        first.append(len(points))
        angles = 2 * np.pi * np.arange(6 * ring) / (6 * ring)
        points += [(ring / rings * np.cos(a), ring / rings * np.sin(a)) for a in angles]
    triangles = []
    for ring in range(1, rings + 1):
        outer, inner = 6 * ring, max(6 * (ring - 1), 1)
        for sector in range(6):
            for k in range(ring):
                a = first[ring] + (sector * ring + k) % outer
                b = first[ring] + (sector * ring + k + 1) % outer
                c = first[ring - 1] + (sector * (ring - 1) + k) % inner
                triangles.append((a, b, c))
                if k < ring - 1:
                    triangles.append((c, b, first[ring - 1] + (sector * (ring - 1) + k + 1) % inner))
    return np.array(points), np.array(triangles)


def ball(splits):
    """The unit sphere: an octahedron split `splits` times, 8 x 4^splits triangles. @return points, triangles"""
    points = [np.array(p, float) for p in ((1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1))]
    triangles = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]
    for _ in range(splits):
        middles, finer = {}, []

        def middle(i, j):
            key = (min(i, j), max(i, j))
            if key not in middles:
                between = points[i] + points[j]
                middles[key] = len(points)
                points.append(between / np.linalg.norm(between))
            return middles[key]

        for a, b, c in triangles:
            ab, bc, ca = middle(a, b), middle(b, c), middle(c, a)
            finer += [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        triangles = finer
    return np.array(points), np.array(triangles)


def tube(around, along, radius, length):
    """A tube about z from -length / 2, rows turned by half a step. @return points, triangles, normals (outward)"""
    row, k = np.meshgrid(np.arange(along + 1), np.arange(around), indexing="ij")
    angle = (2 * np.pi * (k + (row % 2) / 2) / around).ravel()
    normals = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    points = radius * normals + np.outer(length * (row.ravel() / along - 0.5), [0, 0, 1])
    triangles = []
    for i in range(along):
        for j in range(around):
            a, b = i * around + j, i * around + (j + 1) % around
            c, d = a + around, b + around
            triangles += [(a, b, c), (b, d, c)] if i % 2 == 0 else [(a, b, d), (a, d, c)]
    return points, np.array(triangles), normals
