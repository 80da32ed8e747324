"""The compiled loop over time steps: symplectic Euler, one evaluation of the forces each, plastic state committed once a step."""

from __future__ import annotations

import math

import numpy as np

from . import particles as rows
from ._jit import compiled_entry
from .gradients import bound_step, carry_stress, deform, find_fronts, mirror_axis, renormalise
from .lines import WIDTH, write_lines
from .materials.porous_dust import update_stress
from .pairs import sum_forces, sum_gradients
from .projectile import interpolate, measure_surface, press, weigh_wall_layer

LOG = (
    "time",
    "depth",
    "velocity",
    "force",
    "wall_impulse",
    "external_impulse",
    "heat",
    "friction",
    "contact",
    "outside",
)
EIGHT = np.uint64(WIDTH)
BLOCK = np.uint64(
    128
)  # particles between two sums over neighbours at a time; unsigned, or no loop is vectorised

# rows of particles.ROWS, as constants a compiled function can see
(
    X, Z, U, W, MASS, AREA, RING, WEIGHT, SOUND, DENSITY, ZERO_STRESS, INITIAL, SXX, SZZ, SXZ, PRESSURE, WORK, ELASTIC,
    HEAT, GXX, GXZ, GZZ, LXX, LXZ, LZX, LZZ, MXX, MXZ, MZX, MZZ, FX, FZ, DXX, DXZ, DZX, DZZ, SHEAR,
    DISTANCE, NX, NZ, THICKNESS, REST_DENSITY, COMPRESSIVE, TENSILE,
) = range(len(rows.ROWS))  # fmt: skip


@compiled_entry
def advance(
    s, front, back, nearby, beyond, n, axisymmetric, source, twice_plane, fixed, free_mass, near, inner, body_origin,
    start, neighbour, origin, allowed, steps, log, first, body, is_rod, tip_radius, body_mass, gravity, spacing, h, courant,
    viscosity, front_rate, hold_apart, artificial_stress, gap, wall_weight, contact_stiffness, friction,
    side_friction, depth_knots, depth_force, speed_knots, speed_force, stopped, law, extras, strength, tension,
):  # fmt: skip
    """Up to ``steps`` steps, or until a point has moved ``allowed`` from ``origin``. Returns how many were made.

    body: tip height, speed, time, accumulated friction heat. Rows of ``s`` hold n particles and their mirror images.
    """
    x, z, u, w, area, ring, density, sound = s[X], s[Z], s[U], s[W], s[AREA], s[RING], s[DENSITY], s[SOUND]
    images = source.size
    one = np.uint64(1)
    blocks = (np.uint64(n) + BLOCK - one) // BLOCK
    plain = len(extras) == 0  # known to the compiler
    stop = start[1:]
    contact = np.zeros(2)
    for step in range(steps):
        worst = 0.0
        for i in range(n):
            if axisymmetric:
                ring[i] = x[i]
            area[i] = s[MASS, i] / (density[i] * ring[i])
        worst = bound_step(np.uint64(0), np.uint64(n), axisymmetric, h, ring, sound, s[GXX], s[GZZ], worst)
        dt = courant * h / math.sqrt(worst)
        if not (dt > 0.0):
            return -1 - step
        for k in range(images):
            x[n + k] = twice_plane[k] - x[source[k]]
        mirror_axis(n, images, source, z, 1.0)
        mirror_axis(n, images, source, u, -1.0)
        mirror_axis(n, images, source, w, 1.0)
        mirror_axis(n, images, source, area, 1.0)
        for k in range(np.uint64(0), np.uint64(n + images), EIGHT):
            write_lines(front, k, x, z, u, w, area, area, area, area)
        last_dt = body[4]  # the velocities are those of the step that moved the particles, so is its length
        # in blocks: what one pass writes is still in the nearest cache when the next one reads it
        for block in range(blocks):
            low = block * BLOCK
            high = min(low + BLOCK, np.uint64(n))
            sum_gradients(
                low, high, x, z, u, w, front, start, stop, neighbour, nearby, h,
                s[GXX], s[GXZ], s[GZZ], s[LXX], s[LXZ], s[LZX], s[LZZ],
            )  # fmt: skip
            renormalise(low, high, s[GXX], s[GXZ], s[GZZ], s[LXX], s[LXZ], s[LZX], s[LZZ])
            update_stress(
                low, high, last_dt, axisymmetric, plain, law, strength, tension, ring, u, s[LXX], s[LXZ], s[LZX], s[LZZ],
                density, s[ZERO_STRESS], s[INITIAL], s[SXX], s[SZZ], s[SXZ], s[PRESSURE], sound, s[WORK], s[COMPRESSIVE],
                s[TENSILE],
            )  # fmt: skip
            deform(low, high, last_dt, s[LXX], s[LXZ], s[LZX], s[LZZ], s[DXX], s[DXZ], s[DZX], s[DZZ])
            carry_stress(
                low, high, ring, s[PRESSURE], s[SXX], s[SZZ], s[SXZ], s[GXX], s[GXZ], s[GZZ], s[LXZ], s[LZX],
                s[MXX], s[MXZ], s[MZX], s[MZZ], s[SHEAR],
            )  # fmt: skip
        for i in range(n):
            s[WEIGHT, i] = density[i] * ring[i]
            area[i] = s[MASS, i] / s[WEIGHT, i]
        measure_surface(
            near, is_rod, tip_radius, body[0], spacing, x, z, s[DXX], s[DXZ], s[DZX], s[DZZ],
            s[DISTANCE], s[NX], s[NZ], s[THICKNESS],
        )  # fmt: skip
        weigh_wall_layer(
            near, last_dt, spacing, wall_weight, s[DISTANCE], s[NX], s[NZ], s[THICKNESS], ring, s[GXX], s[GXZ], s[GZZ],
            s[MXX], s[MXZ], s[MZX], s[MZZ], s[LXX], s[LXZ], s[LZX], s[LZZ], s[SXX], s[SZZ], s[SXZ], s[PRESSURE],
            density, s[WORK],
        )  # fmt: skip
        if front_rate > 0.0:
            find_fronts(
                np.uint64(0),
                np.uint64(n),
                axisymmetric,
                front_rate,
                h,
                u,
                ring,
                sound,
                s[LXX],
                s[LZZ],
                s[SHEAR],
            )
        if images > 0:
            for k in (AREA, WEIGHT, SOUND, LXX, LZZ, MXX, MZZ):
                mirror_axis(n, images, source, s[k], 1.0)
            for k in (SHEAR, MXZ, MZX):
                mirror_axis(n, images, source, s[k], -1.0)
            if axisymmetric:
                for k in range(images):
                    ratio = x[n + k] / x[source[k]]  # of ring radii: minus one across the axis
                    s[WEIGHT, n + k] *= abs(ratio)
                    # odd for the radial force, so that uniform stress leaves none; even for the axial one: momentum
                    s[MXX, n + k] *= ratio
                    s[MXZ, n + k] *= ratio
                    s[MZX, n + k] *= abs(ratio)
                    s[MZZ, n + k] *= abs(ratio)
        for k in range(np.uint64(0), np.uint64(n + images), EIGHT):
            write_lines(front, k, x, z, u, w, area, s[MZZ], s[MZZ], s[MZZ])
            write_lines(back, k, s[WEIGHT], sound, s[LXX], s[SHEAR], s[LZZ], s[MXX], s[MXZ], s[MZX])
        sum_forces(
            np.uint64(0), np.uint64(n), x, z, u, w, area, s[WEIGHT], sound, s[LXX], s[SHEAR], s[LZZ],
            s[MXX], s[MXZ], s[MZX], s[MZZ], front, back, start, stop, neighbour, nearby, beyond, h, viscosity,
            hold_apart, artificial_stress, s[FX], s[FZ], s[HEAT],
        )  # fmt: skip
        if axisymmetric:
            for i in range(n):
                s[FX, i] += area[i] * (s[SXX, i] + s[SZZ, i] + s[PRESSURE, i])
        force = press(
            near, body[1], spacing, gap, contact_stiffness, friction, s[DISTANCE], s[NX], s[NZ], s[THICKNESS],
            s[REST_DENSITY], u, w, s[MASS], density, sound, s[FX], s[FZ], contact,
        )  # fmt: skip
        depth = -body[0]
        outside = 0.0
        if side_friction > 0.0:
            speed = -body[1]
            outside += side_friction * max(depth, 0.0) * speed / (abs(speed) + 1.0e-3)
        if depth_knots.size > 0:
            outside += interpolate(depth, depth_knots, depth_force)
        if speed_knots.size > 0:
            speed = -body[1]
            outside += interpolate(abs(speed), speed_knots, speed_force) * speed / (abs(speed) + 1.0e-3)
        held = 0.0
        for i in fixed:  # keeps its velocity, nought in a drop
            held -= s[FZ, i]
            s[FX, i] = 0.0
            s[FZ, i] = s[MASS, i] * gravity
        heat = 0.0
        far = 0
        for i in range(n):
            heat += s[HEAT, i]
            u[i] += dt * s[FX, i] / s[MASS, i]
            w[i] += dt * (s[FZ, i] / s[MASS, i] - gravity)
            x[i] += dt * u[i]
            z[i] += dt * w[i]
            dx = x[i] - origin[0, i]
            dz = z[i] - origin[1, i]
            far += 1 if dx * dx + dz * dz > allowed * allowed else 0
        if axisymmetric:
            for i in inner:  # nothing passes the axis
                if x[i] < 1.0e-3 * spacing:
                    x[i] = 1.0e-3 * spacing
                    u[i] = max(u[i], 0.0)
        row = log[first + step]
        body[1] += dt * ((force + outside) / body_mass - gravity)
        body[0] += dt * body[1]
        body[2] += dt
        body[3] += dt * contact[1]
        body[4] = dt
        last = log[first + step - 1]
        row[0], row[1], row[2], row[3] = body[2], -body[0], -body[1], force + outside
        row[4] = last[4] + dt * held
        row[5] = last[5] + dt * (outside - gravity * (free_mass + body_mass))
        row[6] = last[6] + dt * heat
        row[7] = body[3]
        row[8] = last[8] + dt * contact[0]
        row[9] = last[9] - dt * outside * body[1]
        if (
            far > 0
            or abs(body[0] - body_origin) > allowed
            or (body[1] >= 0.0 and not stopped)
            or not (abs(force) < 1.0e300)
        ):
            return step + 1
    return steps
