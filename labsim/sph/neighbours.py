"""Who is near whom: a cell grid and a list with a skin, kept until a particle has moved half the skin.

Lists hold unsigned indices (signed ones make the compiler insert wrap-around code and stop vectorising) and are
padded to a multiple of eight with the particle itself, which contributes exactly nothing to a gradient.
"""

from __future__ import annotations

import numpy as np

from ._jit import compiled_entry


@compiled_entry
def sort_into_cells(n, x, z, x0, z0, size, nx, nz, cell_start, order, cell_of):
    """Counting sort of n points into nx × nz square cells; ``order`` lists points cell by cell."""
    for c in range(nx * nz + 1):
        cell_start[c] = 0
    for i in range(n):
        a = min(max(int((x[i] - x0) / size), 0), nx - 1)
        b = min(max(int((z[i] - z0) / size), 0), nz - 1)
        cell_of[i] = b * nx + a
        cell_start[cell_of[i] + 1] += 1
    for c in range(nx * nz):
        cell_start[c + 1] += cell_start[c]
    fill = cell_start[:-1].copy()
    for i in range(n):
        c = cell_of[i]
        order[fill[c]] = i
        fill[c] += 1


@compiled_entry
def list_neighbours(n, x, z, xs, zs, reach, x0, z0, size, nx, nz, cell_start, order, start, out):
    """Neighbours within ``reach`` of particles 0..n-1 among all sorted points (xs, zs in the order of ``order``). Returns the
    length used, or -1 where ``out`` may be too short. Every candidate is written and kept by moving on: no branch to guess."""
    reach2 = reach * reach
    used = 0
    span = int(reach / size) + 1
    for i in range(n):
        start[i] = used
        xi, zi = x[i], z[i]
        a = min(max(int((xi - x0) / size), 0), nx - 1)
        b = min(max(int((zi - z0) / size), 0), nz - 1)
        for cz in range(max(b - span, 0), min(b + span, nz - 1) + 1):
            first = cell_start[cz * nx + max(a - span, 0)]
            last = cell_start[cz * nx + min(a + span, nx - 1) + 1]
            if used + last - first + 8 > out.size:
                return -1
            for k in range(first, last):
                dx = xi - xs[k]
                dz = zi - zs[k]
                out[used] = order[k]
                used += 1 if dx * dx + dz * dz < reach2 else 0
        while used % 8 != 0:
            out[used] = i
            used += 1
    start[n] = used
    return used


class Neighbours:
    """Neighbour lists of the first n of m points (the others are mirror images)."""

    def __init__(self, reach: float, skin: float) -> None:
        self.reach, self.skin = reach, skin
        self.start = np.zeros(1, dtype=np.int64)
        self.list = np.zeros(8, dtype=np.uint32)

    def build(self, n: int, m: int, x: np.ndarray, z: np.ndarray) -> None:
        reach = self.reach + self.skin
        size = reach / 2
        x0, z0 = x[:m].min(), z[:m].min()
        nx = int((x[:m].max() - x0) / size) + 1
        nz = int((z[:m].max() - z0) / size) + 1
        cell_start = np.zeros(nx * nz + 1, dtype=np.int64)
        order = np.empty(m, dtype=np.uint32)
        sort_into_cells(m, x, z, x0, z0, size, nx, nz, cell_start, order, np.empty(m, dtype=np.int64))
        if self.start.size != n + 1:
            self.start = np.empty(n + 1, dtype=np.int64)
        xs, zs = x[order], z[order]
        while list_neighbours(
            n, x, z, xs, zs, reach, x0, z0, size, nx, nz, cell_start, order, self.start, self.list
        ) < 0:  # fmt: skip
            self.list = np.empty(int(self.list.size * 1.3) + 40 * n, dtype=np.uint32)
