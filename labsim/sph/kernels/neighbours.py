"""Who is near whom: a cell grid and a list with a skin, kept until two particles may have come nearer by the skin.

Lists hold where the neighbours' lines begin (``lines.py``), unsigned (signed numbers make the compiler insert wrap-around
code and stop vectorising) and are padded to a multiple of eight with the particle itself, which contributes exactly
nothing to a gradient.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .._jit import compiled_entry
from .lines import WIDTH


class Cells(NamedTuple):
    """nx × nz cells from x0, z0 on, m."""

    x0: float
    z0: float
    size_x: float
    size_z: float
    nx: int
    nz: int


@compiled_entry
def sort_into_cells(n, x, z, cells, cell_start, order, cell_of):
    """Counting sort of n points into cells; ``order`` lists points cell by cell."""
    x0, z0, size_x, size_z, nx, nz = cells
    for c in range(nx * nz + 1):
        cell_start[c] = 0
    for i in range(n):
        a = min(max(int((x[i] - x0) / size_x), 0), nx - 1)
        b = min(max(int((z[i] - z0) / size_z), 0), nz - 1)
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
def list_neighbours(n, x, z, xs, zs, reach, cells, cell_start, line, start, out):
    """Neighbours within ``reach`` of particles 0..n-1 among all sorted points: xs, zs and where their lines begin. Returns the
    length used, or -1 where ``out`` may be too short. Every candidate is written and kept by moving on: no branch to guess."""
    x0, z0, size_x, size_z, nx, nz = cells
    reach2 = reach * reach
    used = 0
    span = math.ceil(reach / size_z)
    for i in range(n):
        start[i] = used
        xi, zi = x[i], z[i]
        row = min(max(int((zi - z0) / size_z), 0), nz - 1)
        for b in range(max(row - span, 0), min(row + span, nz - 1) + 1):
            # half a chord of the circle: of this row, the cells farther away along x hold no neighbour
            off = max(max(z0 + b * size_z - zi, zi - z0 - (b + 1) * size_z), 0.0)
            half = math.sqrt(max(reach2 - off * off, 0.0))
            low = min(max(int((xi - half - x0) / size_x), 0), nx - 1)
            high = min(max(int((xi + half - x0) / size_x), 0), nx - 1)
            first = cell_start[b * nx + low]
            last = cell_start[b * nx + high + 1]
            if used + last - first + 8 > out.size:
                return -1
            for k in range(first, last):
                dx = xi - xs[k]
                dz = zi - zs[k]
                out[used] = line[k]
                used += 1 if dx * dx + dz * dz < reach2 else 0
        while used % 8 != 0:
            out[used] = WIDTH * i
            used += 1
    start[n] = used
    return used


@compiled_entry
def bound_displacements(m, x, z, x_then, z_then, block_of, nx, nz, box):
    """Largest displacement since the list was made, and the largest of one point relative to another at most two blocks away.

    block_of: block of each point when the list was made; box: (nx nz, 4), what is worked on.
    """
    for c in range(nx * nz):
        box[c, 0] = box[c, 2] = 1.0e300
        box[c, 1] = box[c, 3] = -1.0e300
    for i in range(m):
        c = block_of[i]
        dx = x[i] - x_then[i]
        dz = z[i] - z_then[i]
        box[c, 0] = min(box[c, 0], dx)
        box[c, 1] = max(box[c, 1], dx)
        box[c, 2] = min(box[c, 2], dz)
        box[c, 3] = max(box[c, 3], dz)
    own2 = relative2 = 0.0
    for b in range(nz):
        for a in range(nx):
            c = b * nx + a
            if box[c, 0] > box[c, 1]:
                continue
            dx = max(-box[c, 0], box[c, 1])
            dz = max(-box[c, 2], box[c, 3])
            own2 = max(own2, dx * dx + dz * dz)
            for bb in range(b, min(b + 2, nz - 1) + 1):
                for aa in range(max(a - 2, 0) if bb > b else a, min(a + 2, nx - 1) + 1):
                    o = bb * nx + aa
                    # an empty block gives minus infinity
                    dx = max(max(box[c, 1] - box[o, 0], box[o, 1] - box[c, 0]), 0.0)
                    dz = max(max(box[c, 3] - box[o, 2], box[o, 3] - box[c, 2]), 0.0)
                    relative2 = max(relative2, dx * dx + dz * dz)
    return math.sqrt(own2), math.sqrt(relative2)


class Neighbours:
    """Neighbour lists of the first n of m points (the others are mirror images)."""

    def __init__(self, reach: float, skin: float) -> None:
        self.reach, self.skin = reach, skin
        self.start = np.zeros(1, dtype=np.int64)
        self.list = np.zeros(8, dtype=np.uint32)

    def build(self, n: int, m: int, x: np.ndarray, z: np.ndarray) -> None:
        reach = self.reach + self.skin
        x0, z0 = x[:m].min(), z[:m].min()
        width, height = x[:m].max() - x0, z[:m].max() - z0
        size_x, size_z = reach / 4, reach / 2
        cells = Cells(x0, z0, size_x, size_z, int(width / size_x) + 1, int(height / size_z) + 1)
        cell_start = np.zeros(cells.nx * cells.nz + 1, dtype=np.int64)
        order = np.empty(m, dtype=np.uint32)
        sort_into_cells(m, x, z, cells, cell_start, order, np.empty(m, dtype=np.int64))
        if self.start.size != n + 1:
            self.start = np.empty(n + 1, dtype=np.int64)
        xs, zs, line = x[order], z[order], WIDTH * order
        while list_neighbours(
            n, x, z, xs, zs, reach, cells, cell_start, line, self.start, self.list
        ) < 0:  # fmt: skip
            self.list = np.empty(int(self.list.size * 1.3) + 40 * n, dtype=np.uint32)
        self.then = x[:m].copy(), z[:m].copy()
        self.blocks = int(width / reach) + 1, int(height / reach) + 1
        column, row = ((x[:m] - x0) / reach).astype(np.int64), ((z[:m] - z0) / reach).astype(np.int64)
        self.block_of = row * self.blocks[0] + column

    def spare(self, x: np.ndarray, z: np.ndarray) -> float:
        """How far every point may still move before the list could miss a pair, m; negative where it may miss one now.

        Points that move together do not come nearer to each other. Pairs at most two blocks apart may approach by the skin,
        all others, which were two blocks apart, until only ``reach`` is left between them.
        """
        m = self.then[0].size
        box = np.empty((self.blocks[0] * self.blocks[1], 4))
        own, relative = bound_displacements(m, x, z, *self.then, self.block_of, *self.blocks, box)
        block = self.reach + self.skin
        return 0.5 * min(self.skin - relative, 2 * block - self.reach - 2 * own)
