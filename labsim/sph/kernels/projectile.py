"""The rigid projectile: where its surface is, and what it and the dust do to each other.

A particle near the projectile has neighbours on one side only: of what its kernel weighs, the share m(d) lies beyond the surface,
a half at d = 0. There the velocity is taken as linear from the particle to the wall, so the wall gives that share of the normal
strain rate, and by the adjoint of that very gradient that share of the normal stress pushes the wall:

    n·L·n = (1 - m) (n·L·n of the neighbours) + m (v - v_wall)·n / d,    force = m p V / d

Strain and force come from one gradient, so contact takes no energy. It is closed where dust reaches up to the surface: a cell is
as thick as the deformation gradient D leaves it, dx |Dᵀn|, and keeps the wall from nothing that lies behind it. Never a pull;
Coulomb friction on request.
"""

from __future__ import annotations

import math

from .._jit import compiled
from ..profile import find_surface

UPRIGHT = 1.0e-9  # of the normal along z: less is a shaft
STICK = 0.5  # the largest share of its slip that friction takes from a particle in a step: more would turn the slip round
TOUCHING = 1.05  # half thicknesses of a cell at which contact begins to close
CLOSING = 0.2  # of a half thickness, over which it closes
COVERING = 0.5  # of that, from which on all that lies behind the cell is in contact
COLUMN = 0.75  # spacings to either side of a cell that it covers, fully up to a quarter: one spacing wide, its edges blurred
RANGE = 1.6  # smoothing lengths from which on nothing of the kernel is missing
CLOSEST = 0.2  # spacings; films nearer than that are as stiff as if they were there, for the sake of the step


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
def measure_surface(near, profile, tip_z, spacing, s):
    """Distance to the projectile's surface, its normal into the dust, and the share of its width that each particle's cell
    has kept along that normal, for the particles ``near``. Beyond two spacings it only gets a large distance."""
    x, z, dxx, dxz, dzx, dzz = s.x, s.z, s.dxx, s.dxz, s.dzx, s.dzz
    distance, nx, nz, thickness = s.distance, s.nx, s.nz, s.thickness
    for i in near:
        d, a, b = find_surface(x[i], z[i], tip_z, profile)
        distance[i] = d
        if d > 2.0 * spacing:
            continue
        nx[i] = a
        nz[i] = b
        thickness[i] = min(math.hypot(dxx[i] * a + dzx[i] * b, dxz[i] * a + dzz[i] * b), 1.0)


@compiled
def close_contact(near, films, h, spacing, s):
    """grip m/d (1/m) of each particle ``near`` the surface: the share m of its kernel that the wall stands for, over the
    distance.

    Wendland's kernel misses m = ½ (1 - (d/1.6 h)²)² of its second moment beyond a plane at d, to 0.02. films: room for the
    indices of cells that touch, (near.size,).
    """
    x, z, distance, thickness, nx, nz, grip = s.x, s.z, s.distance, s.thickness, s.nx, s.nz, s.grip
    count = 0
    for i in near:
        half = 0.5 * spacing * thickness[i]
        grip[i] = (TOUCHING * half - distance[i]) / (CLOSING * half)
        if grip[i] > 0.0:
            films[count] = i
            count += 1
    for i in near:
        part = min(grip[i], 1.0)
        grip[i] = 0.0
        far = max(distance[i], 0.0) / (RANGE * h)
        if far < 1.0:
            if part <= 0.0:
                for k in range(count):
                    j = films[k]
                    across = abs((x[i] - x[j]) * nz[i] - (z[i] - z[j]) * nx[i]) / spacing
                    if across < COLUMN:
                        half = 0.5 * spacing * thickness[j]
                        closed = min((TOUCHING * half - distance[j]) / (COVERING * CLOSING * half), 1.0)
                        part = max(part, closed * min(2.0 * (COLUMN - across), 1.0))
            left = 1.0 - far * far
            grip[i] = max(part, 0.0) * 0.5 * left * left / max(distance[i], CLOSEST * spacing)


@compiled
def bound_contact(near, h, s, worst):
    """The larger of ``worst`` and of c² (1 + (0.6 h · grip)²), m²/s²: as ``bound_step`` for particles near the wall."""
    sound, grip = s.sound, s.grip
    for i in near:
        ratio = 0.6 * h * grip[i]
        worst = max(worst, sound[i] ** 2 * (1.0 + ratio * ratio))
    return worst


@compiled
def strain_against_wall(near, speed_z, s):
    """Let the wall take part in the normal row of the velocity gradient L: n·L gets grip ((v - v_wall)·n - d n·L·n) Bn/(n·Bn),
    exact where the velocity is linear up to the wall. wall_rate: that change over grip, for the book of energy. grip becomes 0
    where the dust is pulled and moves away.
    """
    distance, nx, nz, u, w, sxx, szz, sxz, pressure = (
        s.distance,
        s.nx,
        s.nz,
        s.u,
        s.w,
        s.sxx,
        s.szz,
        s.sxz,
        s.pressure,
    )
    bxx, bxz, bzz, lxx, lxz, lzx, lzz = s.gxx, s.gxz, s.gzz, s.lxx, s.lxz, s.lzx, s.lzz
    grip, wall_rate = s.grip, s.wall_rate
    for i in near:
        if grip[i] > 0.0:
            a, b = nx[i], nz[i]
            along_x = a * bxx[i] + b * bxz[i]
            along_z = a * bxz[i] + b * bzz[i]
            across = along_x * a + along_z * b
            own = (a * lxx[i] + b * lzx[i]) * a + (a * lxz[i] + b * lzz[i]) * b
            away = u[i] * a + (w[i] - speed_z) * b
            stress = (sxx[i] - pressure[i]) * a * a + 2.0 * sxz[i] * a * b + (szz[i] - pressure[i]) * b * b
            if across > 0.0 and (stress < 0.0 or away < 0.0):
                wall_rate[i] = (away - max(distance[i], 0.0) * own) / across
                change = grip[i] * wall_rate[i]
                lxx[i] += a * along_x * change
                lxz[i] += a * along_z * change
                lzx[i] += b * along_x * change
                lzz[i] += b * along_z * change
            else:
                grip[i] = 0.0


@compiled
def press(near, speed_z, friction, dt, s, energy):
    """The adjoint of ``strain_against_wall``: take the wall's share out of M (what a particle's stress brings into the sum of
    forces), set fx, fz to the wall's push, and return the force on the projectile along z (per radian or metre).

    Where the traction would pull there is no force, and grip is set to 0: energy[0] is the power that the stresses spent on
    the wall's strain all the same; energy[1] is the power lost to friction, energy[2] the part of the force that acts where the
    surface is upright: on the shaft.
    """
    distance, nx, nz, grip, wall_rate, ring, mass = (
        s.distance,
        s.nx,
        s.nz,
        s.grip,
        s.wall_rate,
        s.ring,
        s.mass,
    )
    density, u, w, sxx, szz, sxz, pressure = s.density, s.u, s.w, s.sxx, s.szz, s.sxz, s.pressure
    bxx, bxz, bzz, mxx, mxz, mzx, mzz = s.gxx, s.gxz, s.gzz, s.mxx, s.mxz, s.mzx, s.mzz
    fx, fz, yield_square = s.push_x, s.push_z, s.yield_square
    force = 0.0
    taken = 0.0
    lost = 0.0
    beside = 0.0
    for i in near:
        fx[i] = fz[i] = 0.0
        if grip[i] > 0.0:
            a, b = nx[i], nz[i]
            along_x = a * bxx[i] + b * bxz[i]
            along_z = a * bxz[i] + b * bzz[i]
            traction = (a * (sxx[i] - pressure[i]) + b * sxz[i]) * along_x
            traction += (a * sxz[i] + b * (szz[i] - pressure[i])) * along_z
            held = grip[i] * traction
            volume = mass[i] / density[i]
            if traction >= 0.0:
                taken -= volume * held * wall_rate[i]
                grip[i] = 0.0
                continue
            held /= along_x * a + along_z * b
            share = held * max(distance[i], 0.0) * ring[i]
            mxx[i] -= a * share * along_x
            mxz[i] -= a * share * along_z
            mzx[i] -= b * share * along_x
            mzz[i] -= b * share * along_z
            px, pz = -held * volume * a, -held * volume * b
            if friction > 0.0:
                slip = -u[i] * b + (w[i] - speed_z) * a
                # held < 0. Beyond what the matter bears in shear it yields; held as fast as a step allows it sticks
                bound = math.sqrt(yield_square[i] / 3.0) * grip[i] * volume / (along_x * a + along_z * b)
                drag = min(-friction * held * volume, bound)
                drag = -slip * min(drag / max(abs(slip), 1e-30), STICK * mass[i] / dt)
                px -= drag * b
                pz += drag * a
                lost -= drag * slip
            fx[i] = px
            fz[i] = pz
            force -= pz
            if abs(b) < UPRIGHT:
                beside -= pz
    energy[0] = taken
    energy[1] = lost
    energy[2] = beside
    return force
