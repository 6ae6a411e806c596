#!/usr/bin/python3
"""Largest error of one curved patch over random triangles of known surfaces, by the independent evaluation of the tests.

    PYTHONPATH=tests/support tests/bench/patch_errors.py

Corners and normals are the surface's own. Mean and largest of 100 triangles, in millionths of the unit; edges are about
0.5, of the ellipsoid and the torus 0.25.
"""
import numpy as np

from curved_patch import patch_points, watertight_points


def pn_points(corners, normals, barycentric):
    """Curved PN triangles: Vlachos, Peters, Boyd, Mitchell, I3D 2001."""
    edge = {(i, j): (2 * corners[i] + corners[j] - ((corners[j] - corners[i]) @ normals[i]) * normals[i]) / 3
            for i in range(3) for j in range(3) if i != j}
    mean = sum(edge.values()) / 6
    b = barycentric.T
    points = sum(np.outer(b[i]**3, corners[i]) for i in range(3))
    points += sum(np.outer(3 * b[i]**2 * b[j], p) for (i, j), p in edge.items())
    return points + np.outer(6 * b[0] * b[1] * b[2], mean + (mean - corners.mean(axis=0)) / 2)


def bumpy(p):
    r = np.linalg.norm(p, axis=-1)
    x, y, z = (p / r[..., None]).T
    return r - (1 + 0.1 * np.sin(3 * x + 1) * np.cos(3 * y) + 0.1 * np.sin(4 * z))


SURFACES = {  # zero on the surface; size of the triangles
    "sphere": (lambda p: (p**2).sum(-1) - 1, 0.5),
    "ellipsoid 1 : 0.7 : 0.5": (lambda p: ((p / [1, 0.7, 0.5])**2).sum(-1) - 1, 0.25),
    "torus 1 : 0.4": (lambda p: (np.hypot(p[..., 0], p[..., 1]) - 1)**2 + p[..., 2]**2 - 0.16, 0.25),
    "bumpy ball": (bumpy, 0.5),
    "cylinder": (lambda p: p[..., 0]**2 + p[..., 1]**2 - 1, 0.5),
}


def gradient(f, p):
    e = 1e-5 * np.eye(3)
    return np.stack([(f(p + d) - f(p - d)) / 2e-5 for d in e], axis=-1)


def on_surface(f, p):
    for _ in range(30):
        g = gradient(f, p)
        p = p - (f(p) / (g**2).sum(-1))[:, None] * g
    return p


def main():
    random = np.random.default_rng(1)
    grid = np.array([(12 - i - j, i, j) for i in range(13) for j in range(13 - i)]) / 12
    kinds = {"comas": patch_points, "watertight": watertight_points, "PN": pn_points}
    for name, (f, size) in SURFACES.items():
        errors = {kind: [] for kind in kinds}
        for _ in range(100):
            start = random.normal(size=3)
            start /= np.linalg.norm(start)
            if name.startswith("torus"):
                u, v = random.uniform(0, 2 * np.pi, 2)
                start = np.array([(1 + 0.4 * np.cos(v)) * np.cos(u), (1 + 0.4 * np.cos(v)) * np.sin(u), 0.4 * np.sin(v)])
            middle = on_surface(f, start[None])
            n = gradient(f, middle)[0]
            n /= np.linalg.norm(n)
            x = np.cross(n, [0.3, 0.5, 0.7])
            x /= np.linalg.norm(x)
            angle = random.uniform(0, 2 * np.pi) + np.array([0, 2, 4]) * np.pi / 3 + random.uniform(-0.4, 0.4, 3)
            corners = on_surface(f, middle + 0.58 * size * (np.outer(np.cos(angle), x) + np.outer(np.sin(angle), np.cross(n, x))))
            normals = gradient(f, corners)
            normals /= np.linalg.norm(normals, axis=1)[:, None]
            for kind, points in kinds.items():
                p = points(corners, normals, grid)
                errors[kind].append((np.abs(f(p)) / np.linalg.norm(gradient(f, p), axis=1)).max())
        print(f"| {name} | " + " | ".join(f"{1e6 * np.mean(e):.3g} ({1e6 * np.max(e):.3g})" for e in errors.values()) + " |")


if __name__ == "__main__":
    main()
