"""The rigid projectile: where its surface is, and what it and the dust do to each other.

Contact is a stiff push along the surface normal, never a pull, with Coulomb friction. Two things make it converge fast in
the spacing (docs/numerics.md has the figures):

- Its reach is the half thickness of the cell of a particle that lies against it. Flow along the surface thins a cell to
  |Dᵀn| of its width while others move in beside it, compaction alone would leave it 1/J: the geometric mean is used.
- A particle there has neighbours on one side only, and its gradient across the surface would count its whole volume, of which
  half lies between it and the surface. WALL_WEIGHT is the share with which uniform stress leaves no force on the next
  particles (the patch test on the lattice, solved for the kernel in use).
"""

from __future__ import annotations

import math

import numpy as np

from ._jit import compiled
from .pairs import GRADIENT_NORM

SLIP_SPEED = 1.0e-3  # m/s, over which friction turns round


def solve_wall_weight(smoothing: float) -> float:
    """Weight of the outermost lattice layer's normal gradient for which uniform stress leaves no net force on the second.

    smoothing : smoothing length in spacings. Nodal integration on a half plane of unit spacing; linear in the weight.
    """
    layers, columns = 12, np.arange(-6, 7)

    def slope(across: float, along: float) -> float:
        part = 1 - math.hypot(across, along) / (2 * smoothing)
        return GRADIENT_NORM / smoothing**4 * max(part, 0.0) ** 3

    coupling = np.array(
        [[sum(slope(k - l, c) for c in columns) * (l - k) for l in range(layers)] for k in range(layers)]
    )
    offsets = np.arange(layers)[None, :] - np.arange(layers)[:, None]
    moment = -np.sum(coupling * offsets, axis=1)
    # force on the second layer from layer l: (weight_l / moment_l + weight_1 / moment_1) coupling
    inverse = 1 / moment
    rest = (
        sum((inverse[l] + inverse[1]) * coupling[1, l] for l in range(1, layers))
        + inverse[1] * coupling[1, 0]
    )
    return float(-rest / (inverse[0] * coupling[1, 0]))


@compiled
def interpolate(at, knots, values):
    """Piecewise linear, constant beyond the ends; knots rising."""
    if at <= knots[0]:
        return values[0]
    for k in range(1, knots.size):
        if at <= knots[k]:
            return values[k - 1] + (values[k] - values[k - 1]) * (at - knots[k - 1]) / (
                knots[k] - knots[k - 1]
            )
    return values[-1]


@compiled
def measure_surface(
    near, is_rod, tip_radius, tip_z, spacing, x, z, dxx, dxz, dzx, dzz, distance, nx, nz, thickness
):
    """Distance to the projectile's surface, its normal into the dust, and the share of its width that each particle's cell
    has kept along that normal, for the particles ``near``. Beyond two spacings it only gets a large distance."""
    centre = tip_z + tip_radius
    for i in near:
        distance[i] = 1.0e9
        if is_rod and z[i] > centre:
            a = 1.0 if x[i] > 0.0 else -1.0
            b = 0.0
            d = abs(x[i]) - tip_radius
        else:
            a = x[i]
            b = z[i] - centre
            length = math.sqrt(a * a + b * b)
            d = length - tip_radius
            if d > 2.0 * spacing or length == 0.0:
                continue
            a /= length
            b /= length
        distance[i] = d
        nx[i] = a
        nz[i] = b
        thickness[i] = min(math.hypot(dxx[i] * a + dzx[i] * b, dxz[i] * a + dzz[i] * b), 1.0)


@compiled
def weigh_wall_layer(
    near, dt, spacing, weight, distance, nx, nz, thickness, ring, bxx, bxz, bzz, mxx, mxz, mzx, mzz,
    lxx, lxz, lzx, lzz, sxx, szz, sxz, pressure, density, work,
):  # fmt: skip
    """Reduce the normal part of the gradient that carries the stress of particles lying against the projectile to
    ``weight``: B <- (I - (1 - weight) n n) B in M. Fades out between 1.3 and 2 half thicknesses from the surface. The stress
    power booked for them is reduced alike; the contact books what the dust between them and the surface takes."""
    for i in near:
        if distance[i] < 2.0 * spacing:
            half = 0.5 * spacing * thickness[i]
            share = (1.0 - weight) * min(max((2.0 * half - distance[i]) / (0.7 * half), 0.0), 1.0)
            if share > 0.0:
                a, b = nx[i], nz[i]
                traction_x = (sxx[i] - pressure[i]) * a + sxz[i] * b
                traction_z = sxz[i] * a + (szz[i] - pressure[i]) * b
                first = share * ring[i] * (a * bxx[i] + b * bxz[i])
                second = share * ring[i] * (a * bxz[i] + b * bzz[i])
                mxx[i] -= traction_x * first
                mxz[i] -= traction_x * second
                mzx[i] -= traction_z * first
                mzz[i] -= traction_z * second
                work[i] -= (
                    dt * share / density[i]
                    * (traction_x * (lxx[i] * a + lxz[i] * b) + traction_z * (lzx[i] * a + lzz[i] * b))
                )  # fmt: skip


@compiled
def press(
    near, speed_z, spacing, gap, stiffness, friction, distance, nx, nz, thickness, rest_density,
    u, w, mass, density, sound, fx, fz, energy,
):  # fmt: skip
    """Add contact forces to fx, fz; return the force on the projectile along z (per radian or metre).

    energy[0] is set to the power that goes into the contact (held there, or spent on the thinning of the dust between the
    particles and the surface), energy[1] to the power lost to friction.
    """
    force = 0.0
    taken = 0.0
    lost = 0.0
    for i in near:
        if distance[i] < spacing:
            reach = gap * spacing * math.sqrt(thickness[i] * min(rest_density[i] / density[i], 1.0))
            overlap = reach - distance[i]
            if overlap > 0.0:
                push = stiffness * mass[i] * (sound[i] / spacing) ** 2 * overlap
                taken -= push * (u[i] * nx[i] + (w[i] - speed_z) * nz[i])
                px, pz = push * nx[i], push * nz[i]
                if friction > 0.0:
                    slip = -u[i] * nz[i] + (w[i] - speed_z) * nx[i]
                    drag = -friction * push * slip / (abs(slip) + SLIP_SPEED)
                    px -= drag * nz[i]
                    pz += drag * nx[i]
                    lost -= drag * slip
                fx[i] += px
                fz[i] += pz
                force -= pz
    energy[0] = taken
    energy[1] = lost
    return force
