"""The compiled loop over time steps: symplectic Euler, one evaluation of the forces each, plastic state committed once a step."""

from __future__ import annotations

import math

import numpy as np

from .._jit import compiled_loop
from ..materials.porous_dust import update  # another law: `load_loop` puts its name here
from ..state import FRICTION, LAST_STEP, REST, SPEED, TIME, TIP
from .gradients import (
    bound_step,
    carry_stress,
    deform,
    find_compaction,
    find_fronts,
    mirror_axis,
    renormalise,
)
from .lines import WIDTH, write_lines
from .pairs import sum_forces, sum_gradients
from .projectile import (
    bound_contact,
    close_contact,
    interpolate,
    measure_surface,
    press,
    strain_against_wall,
)

EIGHT = np.uint64(WIDTH)
BLOCK = np.uint64(
    128
)  # particles between two sums over neighbours at a time; unsigned, or no loop is vectorised


@compiled_loop
def advance(s, own, lists, lines, numbers, outside, constants, tables, log, body, stretch):
    """Up to ``stretch.steps`` steps, or until a point has moved ``stretch.allowed``. Returns how many were made.

    s, own: Rows, and those of the law; body: tip height, speed, time, accumulated friction heat, last step.
    """
    x, z, u, w, area, ring, density, sound, mass = (
        s.x,
        s.z,
        s.u,
        s.w,
        s.area,
        s.ring,
        s.density,
        s.sound,
        s.mass,
    )
    n, axisymmetric, h, spacing, gravity = (
        numbers.n,
        numbers.axisymmetric,
        numbers.h,
        numbers.spacing,
        numbers.gravity,
    )
    source, twice_plane, near, origin, front, back = (
        lists.source, lists.twice_plane, lists.near, lists.origin, lines.front, lines.back,
    )  # fmt: skip
    images = source.size
    one = np.uint64(1)
    blocks = (np.uint64(n) + BLOCK - one) // BLOCK
    allowed, first = stretch.allowed, stretch.first
    films, lost = lists.films, lines.lost
    led = outside.path_time.size > 0
    for step in range(stretch.steps):
        worst = 0.0
        for i in range(n):
            if axisymmetric:
                ring[i] = x[i]
            area[i] = mass[i] / (density[i] * ring[i])
        worst = bound_step(np.uint64(0), np.uint64(n), axisymmetric, h, s, worst)
        worst = bound_contact(near, h, s, worst)
        dt = numbers.courant * h / math.sqrt(worst)
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
        last_dt = body[
            LAST_STEP
        ]  # the velocities are those of the step that moved the particles, so is its length
        measure_surface(near, numbers.profile, body[TIP], spacing, s)
        close_contact(near, films, h, spacing, s)
        met = 0
        # in blocks: what one pass writes is still in the nearest cache when the next one reads it
        for block in range(blocks):
            low = block * BLOCK
            high = min(low + BLOCK, np.uint64(n))
            sum_gradients(low, high, s, lists, lines, h)
            renormalise(low, high, s)
            first_near = met
            while met < near.size and near[met] < high:
                met += 1
            strain_against_wall(near[first_near:met], body[SPEED], s)
            update(low, high, last_dt, axisymmetric, s, own, constants, tables)
            find_compaction(low, high, axisymmetric, numbers.diffusivity, numbers.reference, s)
            deform(low, high, last_dt, s)
            carry_stress(low, high, s)
        for i in range(n):
            s.weight[i] = density[i] * ring[i]
            area[i] = mass[i] / s.weight[i]
        force = press(near, body[SPEED], numbers.friction, dt, s, lost)
        if numbers.front > 0.0:
            find_fronts(np.uint64(0), np.uint64(n), axisymmetric, numbers.front, h, s)
        if images > 0:
            for each in (area, s.compaction, s.diffusivity, s.weight, sound, s.lxx, s.lzz, s.mxx, s.mzz):
                mirror_axis(n, images, source, each, 1.0)
            for each in (s.shear, s.mxz, s.mzx):
                mirror_axis(n, images, source, each, -1.0)
            if axisymmetric:
                for k in range(images):
                    ratio = x[n + k] / x[source[k]]  # of ring radii: minus one across the axis
                    s.weight[n + k] *= abs(ratio)
                    # odd for the radial force, so that uniform stress leaves none; even for the axial one: momentum
                    s.mxx[n + k] *= ratio
                    s.mxz[n + k] *= ratio
                    s.mzx[n + k] *= abs(ratio)
                    s.mzz[n + k] *= abs(ratio)
        for k in range(np.uint64(0), np.uint64(n + images), EIGHT):
            write_lines(front, k, x, z, u, w, area, s.mzz, s.compaction, s.diffusivity)
            write_lines(back, k, s.weight, sound, s.lxx, s.shear, s.lzz, s.mxx, s.mxz, s.mzx)
        sum_forces(np.uint64(0), np.uint64(n), s, lists, lines, numbers)
        if axisymmetric:
            for i in range(n):
                s.fx[i] += area[i] * (s.sxx[i] + s.szz[i] + s.pressure[i])
        for i in near:
            s.fx[i] += s.push_x[i]
            s.fz[i] += s.push_z[i]
        depth = -body[TIP]
        speed = -body[SPEED]
        way = speed / (abs(speed) + REST)  # against which friction pushes
        pushed = 0.0
        if outside.side_friction > 0.0:
            pushed += outside.side_friction * max(depth, 0.0) * way
        if outside.depth_knots.size > 0:
            pushed += interpolate(depth, outside.depth_knots, outside.depth_force)
        if outside.speed_knots.size > 0:
            pushed += interpolate(abs(speed), outside.speed_knots, outside.speed_force) * way
        if outside.time_knots.size > 0:
            pushed += interpolate(body[TIME], outside.time_knots, outside.time_force) * way
        if outside.viscosity_knots.size > 0:
            pushed += interpolate(depth, outside.viscosity_knots, outside.viscosity) * speed
        if outside.drag_knots.size > 0:
            pushed += interpolate(depth, outside.drag_knots, outside.drag) * abs(speed) * speed
        if (outside.mass_knots.size > 0 or outside.gathered_knots.size > 0) and not led:
            # one more body, whose push on the projectile is this. Dust that sticks has its speed when it does
            stuck = (
                interpolate(depth, outside.mass_knots, outside.stuck) if outside.mass_knots.size > 0 else 0.0
            )
            if outside.gathered_knots.size > 0:  # (m v)' = F: dust that lay still takes v² dm/dz
                here = interpolate(depth, outside.gathered_knots, outside.gathered)
                below = interpolate(depth + 1.0e-3 * spacing, outside.gathered_knots, outside.gathered)
                pushed += (below - here) / (1.0e-3 * spacing) * max(speed, 0.0) ** 2
                stuck += here
            share = numbers.body_mass / max(numbers.body_mass + stuck, 0.1 * numbers.body_mass)
            pushed = share * (force + pushed) - force
        held = 0.0
        for i in lists.fixed:  # keeps its velocity, nought in a drop
            held -= s.fz[i]
            s.fx[i] = 0.0
            s.fz[i] = mass[i] * gravity
        heat = 0.0
        far = 0
        for i in range(n):
            heat += s.heat[i]
            u[i] += dt * s.fx[i] / mass[i]
            w[i] += dt * (s.fz[i] / mass[i] - gravity)
            x[i] += dt * u[i]
            z[i] += dt * w[i]
            dx = x[i] - origin[0, i]
            dz = z[i] - origin[1, i]
            far += 1 if dx * dx + dz * dz > allowed * allowed else 0
        if axisymmetric:
            for i in lists.inner:  # nothing passes the axis
                if x[i] < 1.0e-3 * spacing:
                    x[i] = 1.0e-3 * spacing
                    u[i] = max(u[i], 0.0)
        row = log[first + step]
        body[SPEED] += dt * ((force + pushed) / numbers.body_mass - gravity)
        if led:
            below = interpolate(body[TIME] + dt, outside.path_time, outside.path_depth)
            body[SPEED] = -(below + body[TIP]) / dt
        body[TIP] += dt * body[SPEED]
        body[TIME] += dt
        body[FRICTION] += dt * lost[1]
        body[LAST_STEP] = dt
        last = log[first + step - 1]
        row[0], row[1], row[2], row[3] = body[TIME], -body[TIP], -body[SPEED], force + pushed
        row[4] = last[4] + dt * held
        row[5] = last[5] + dt * (pushed - gravity * (numbers.free_mass + numbers.body_mass))
        row[6] = last[6] + dt * heat
        row[7] = body[FRICTION]
        row[8] = last[8] + dt * lost[0]
        row[9] = last[9] - dt * pushed * body[SPEED]
        if led:  # the driver carries the projectile, and pushes the dust
            row[5] += dt * (gravity * numbers.body_mass - force - pushed)
            row[10] = last[10] - dt * (force + pushed) * body[SPEED]
        row[11] = last[11] - dt * lost[2] * body[SPEED]
        if (
            far > 0
            or abs(body[TIP] - stretch.body_origin) > allowed
            or (body[SPEED] >= 0.0 and not stretch.stopped)
            or not (abs(force) < 1.0e300)
        ):
            return step + 1
    return stretch.steps
