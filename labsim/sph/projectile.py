"""The rigid projectile: where its surface is, and what it and the dust do to each other.

Contact is a stiff push along the surface normal, never a pull, with Coulomb friction. Its reach is half the thickness that
the particle's own cell has kept along the normal, |Dᵀn|: dust that was compacted against the surface sits closer to it.
"""

from __future__ import annotations

import math

from ._jit import compiled

SLIP_SPEED = 1.0e-3  # m/s, over which friction turns round


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
def press(
    n, is_rod, tip_radius, tip_z, speed_z, spacing, gap, stiffness, friction,
    x, z, u, w, mass, sound, dxx, dxz, dzx, dzz, fx, fz, energy,
):  # fmt: skip
    """Add contact forces to fx, fz; return the force on the projectile along z (per radian or metre).

    energy[0] is set to the power that goes into the contact (held there, or spent on the thinning of the dust that the
    reach stands for), energy[1] to the power lost to friction.
    """
    centre = tip_z + tip_radius
    force = 0.0
    taken = 0.0
    lost = 0.0
    for i in range(n):
        if is_rod and z[i] > centre:
            nx = 1.0 if x[i] > 0.0 else -1.0
            nz = 0.0
            distance = abs(x[i]) - tip_radius
        else:
            nx = x[i]
            nz = z[i] - centre
            length = math.sqrt(nx * nx + nz * nz)
            distance = length - tip_radius
            if distance < spacing:
                nx /= length
                nz /= length
        if distance < spacing:
            a = dxx[i] * nx + dzx[i] * nz
            b = dxz[i] * nx + dzz[i] * nz
            overlap = gap * spacing * min(math.sqrt(a * a + b * b), 1.0) - distance
            if overlap > 0.0:
                k = stiffness * mass[i] * (sound[i] / spacing) ** 2
                push = k * overlap
                taken -= push * (u[i] * nx + (w[i] - speed_z) * nz)
                px, pz = push * nx, push * nz
                if friction > 0.0:
                    slip = -u[i] * nz + (w[i] - speed_z) * nx
                    drag = -friction * push * slip / (abs(slip) + SLIP_SPEED)
                    px -= drag * nz
                    pz += drag * nx
                    lost -= drag * slip
                fx[i] += px
                fz[i] += pz
                force -= pz
    energy[0] = taken
    energy[1] = lost
    return force
