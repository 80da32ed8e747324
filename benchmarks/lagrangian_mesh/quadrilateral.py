"""A drop on an axisymmetric Lagrangian mesh of quadrilaterals: the cells move with the dust, one stress in each.

Per radian throughout. A cell of area A and mean corner radius r has the volume r A; with the corner gradients b of its
area its rate of dilatation is then exactly b·v + (mean of v_r)/r, so that mass is kept to round-off. One point of quadrature
and viscous hourglass control: Flanagan & Belytschko (1981).
Law: Güttler et al. (2009), eqs. 4-6; Sirono (2004). Central differences in time. SI.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

# columns of a cell
MASS, VOLUME, PHI, PHI0, PRESSURE, SRR, SZZ, SRZ, PLASTIC, STRENGTH = range(10)
COLUMNS = 10  # PLASTIC: equivalent plastic strain of shear; STRENGTH: factor on Σ here
# entries of what has been spent, J per radian
STRESS_WORK, VISCOUS, HOURGLASS = range(3)
EDGE = 0.002  # of φ to the poles of Σ: below it Σ stays as it is there, above it follows its tangent
LEAST = 0.1  # of Σ, that creep leaves
SLIP = 1e-3  # m/s, below which friction on the way up is less
REFERENCE = 0.15  # φ at which the bulk modulus is stated


@njit(inline="always")
def find_strengths(phi, law):
    """Σ and |T| in Pa at φ. law: p_m, φ1, φ2, Δ ln 10, K0, μ/K, shear factor, tensile factor, solid density, gas pressure, φ at
    the start, rate factor and exponent, share of Σ that shear takes, plastic strain for half of it, growth of Y with it, share
    of Σ that creep takes with the logarithm of time, its time, the time since contact."""
    p_m, phi_1, phi_2, exponent = law[:4]
    inside = min(max(phi, phi_1 + EDGE), phi_2 - EDGE)
    compressive = p_m * ((inside - phi_1) / (phi_2 - inside)) ** exponent
    if phi > inside:
        compressive *= 1.0 + exponent * (1.0 / (inside - phi_1) + 1.0 / (phi_2 - inside)) * (phi - inside)
    return compressive, law[7] * 10.0 ** (2.8 + 1.48 * phi)


@njit(inline="always")
def find_unstressed(phi, pressure, k0):
    """φ0′ whose elastic line K0 (φ0′/0.15)^4 (φ/φ0′ - 1) goes through (φ, p): Newton's method, from φ."""
    x = phi
    for _ in range(30):
        k = k0 * (x / REFERENCE) ** 4
        change = (k * (phi / x - 1.0) - pressure) / (k * (3.0 * phi / x - 4.0) / x)
        x -= change
        if abs(change) < 1e-12:
            break
    return x


@njit(cache=True)
def load_nodes(r, z, u, v, dt, cells, law, damping, force_r, force_z, spent):
    """Strain every cell by the velocities that brought its corners here within dt; set the forces on the nodes.

    r, z, u, v, force_r, force_z : (n+1, m+1), nodes; the first index grows with r, the second downwards
    cells : (n, m, COLUMNS); damping : linear and quadratic bulk viscosity, hourglass
    spent : (3,), added to. Returns the shortest time (s) in which sound crosses a cell, or -1 where a cell has turned over.
    """
    k0, shear_to_bulk, shear_factor, solid, gas, phi_start = law[4], law[5], law[6], law[8], law[9], law[10]
    eta, rate_n, weakening, halving, hardening = law[11], law[12], law[13], law[14], law[15]
    crept = max(1.0 - law[16] * math.log(1.0 + law[18] / law[17]), LEAST)
    linear, quadratic, hourglass = damping
    force_r[:] = 0.0
    force_z[:] = 0.0
    shortest = 1e9
    half = 0.5 * dt
    for i in range(cells.shape[0]):
        for j in range(cells.shape[1]):
            cell = cells[i, j]
            # corners anticlockwise from the lower left; d: across, from 3 to 1 and from 4 to 2
            r1, r2, r3, r4 = r[i, j + 1], r[i + 1, j + 1], r[i + 1, j], r[i, j]
            z1, z2, z3, z4 = z[i, j + 1], z[i + 1, j + 1], z[i + 1, j], z[i, j]
            u1, u2, u3, u4 = u[i, j + 1], u[i + 1, j + 1], u[i + 1, j], u[i, j]
            v1, v2, v3, v4 = v[i, j + 1], v[i + 1, j + 1], v[i + 1, j], v[i, j]
            du1, du2, dv1, dv2 = u1 - u3, u2 - u4, v1 - v3, v2 - v4
            dr1, dr2, dz1, dz2 = r1 - r3, r2 - r4, z1 - z3, z2 - z4
            mean_u = 0.25 * (u1 + u2 + u3 + u4)
            mean_r = 0.25 * (r1 + r2 + r3 + r4)
            # rates at the middle of the step
            mr1, mr2, mz1, mz2 = dr1 - half * du1, dr2 - half * du2, dz1 - half * dv1, dz2 - half * dv2
            per_area = 1.0 / (mr1 * mz2 - mr2 * mz1)
            lrr = (mz2 * du1 - mz1 * du2) * per_area
            lrz = (mr1 * du2 - mr2 * du1) * per_area
            lzr = (mz2 * dv1 - mz1 * dv2) * per_area
            lzz = (mr1 * dv2 - mr2 * dv1) * per_area
            hoop = mean_u / (mean_r - half * mean_u)
            area = 0.5 * (dr1 * dz2 - dr2 * dz1)
            if area <= 0.0:
                return -1.0
            volume = mean_r * area
            middle = 0.5 * (volume + cell[VOLUME])
            phi = cell[MASS] / (solid * volume)
            div = lrr + lzz + hoop
            # pressure
            compressive, tensile = find_strengths(phi, law)
            compressive *= cell[STRENGTH] * crept
            if weakening > 0.0:
                compressive *= 1.0 - weakening * (1.0 - 2.0 ** (-cell[PLASTIC] / halving))
            if eta > 0.0 and div < 0.0:
                compressive *= 1.0 + eta * (-div) ** rate_n
            phi0 = cell[PHI0]
            elastic = k0 * (phi0 / REFERENCE) ** 4 * (phi / phi0 - 1.0)
            pressure = max(min(elastic, compressive), -tensile)
            if pressure != elastic:
                phi0 = find_unstressed(phi, pressure, k0)
            bulk = k0 * (phi0 / REFERENCE) ** 4
            mu = shear_to_bulk * bulk
            # gas that cannot leave the pores, at one temperature
            pressure += gas * (phi - phi_start) / (1.0 - phi)
            # deviatoric stress: Jaumann's rate, then back along the radius to von Mises' surface
            spin, shear = 0.5 * (lrz - lzr), 0.5 * (lrz + lzr)
            err, ezz, ett = lrr - div / 3.0, lzz - div / 3.0, hoop - div / 3.0
            srr = cell[SRR] + dt * (2.0 * mu * err + 2.0 * spin * cell[SRZ])
            szz = cell[SZZ] + dt * (2.0 * mu * ezz - 2.0 * spin * cell[SRZ])
            srz = cell[SRZ] + dt * (2.0 * mu * shear + spin * (cell[SZZ] - cell[SRR]))
            mises = math.sqrt(1.5 * (srr * srr + szz * szz + (srr + szz) ** 2) + 3.0 * srz * srz)
            strength = shear_factor * math.sqrt(compressive * tensile)
            if hardening != 0.0:
                strength *= 1.0 + hardening * cell[PLASTIC]
            if mises > strength:
                cell[PLASTIC] += (mises - strength) / (3.0 * mu)
                back = strength / mises
                srr, szz, srz = back * srr, back * szz, back * srz
            stt = -srr - szz
            spent[STRESS_WORK] += 0.5 * dt * middle * (
                -(cell[PRESSURE] + pressure) * div + (cell[SRR] + srr) * err + (cell[SZZ] + szz) * ezz
                + (stt - cell[SRR] - cell[SZZ]) * ett + 2.0 * (cell[SRZ] + srz) * shear
            )  # fmt: skip
            cell[VOLUME], cell[PHI], cell[PHI0], cell[PRESSURE] = volume, phi, phi0, pressure
            cell[SRR], cell[SZZ], cell[SRZ] = srr, szz, srz
            # bulk viscosity, on compression
            rho = phi * solid
            stiffness = bulk * phi / phi0 + 4.0 / 3.0 * mu + gas * phi * (1.0 - phi_start) / (1.0 - phi) ** 2
            sound = math.sqrt(stiffness / rho)
            length = math.sqrt(area)
            viscous = rho * length * (quadratic * length * div - linear * sound) * min(div, 0.0)
            spent[VISCOUS] -= viscous * div * dt * middle
            total = pressure + viscous
            # forces: minus the power of the stresses on the corners' velocities
            trr, tzz, trz = 0.5 * mean_r * (srr - total), 0.5 * mean_r * (szz - total), 0.5 * mean_r * srz
            ring = 0.25 * area * (stt - total)
            # hourglass: the part of the corners' velocities that no linear field has
            hr, hz = r1 - r2 + r3 - r4, z1 - z2 + z3 - z4
            k1 = 0.5 * (hr * dz2 - hz * dr2) / area
            k2 = 0.5 * (hz * dr1 - hr * dz1) / area
            gu = u1 - u2 + u3 - u4 - k1 * du1 - k2 * du2
            gv = v1 - v2 + v3 - v4 - k1 * dv1 - k2 * dv2
            held = 0.25 * hourglass * rho * sound * length * mean_r
            spent[HOURGLASS] += held * (gu * gu + gv * gv) * dt
            gu, gv = held * gu, held * gv
            fr1, fz1 = trr * dz2 - trz * dr2, trz * dz2 - tzz * dr2
            fr2, fz2 = trz * dr1 - trr * dz1, tzz * dr1 - trz * dz1
            force_r[i, j + 1] -= fr1 + ring + (1.0 - k1) * gu
            force_r[i + 1, j + 1] -= fr2 + ring - (1.0 + k2) * gu
            force_r[i + 1, j] -= -fr1 + ring + (1.0 + k1) * gu
            force_r[i, j] -= -fr2 + ring - (1.0 - k2) * gu
            force_z[i, j + 1] -= fz1 + (1.0 - k1) * gv
            force_z[i + 1, j + 1] -= fz2 - (1.0 + k2) * gv
            force_z[i + 1, j] -= -fz1 + (1.0 + k1) * gv
            force_z[i, j] -= -fz2 - (1.0 - k2) * gv
            across = math.sqrt(max(dr1 * dr1 + dz1 * dz1, dr2 * dr2 + dz2 * dz2))
            shortest = min(shortest, area / (across * sound))
    return shortest


@njit(inline="always")
def find_surface(r, z, tip, radius, sphere):
    """Signed distance of (r, z) to the projectile, whose lowest point is at ``tip``, and the outward normal there."""
    up = z - (tip + radius)
    if up > 0.0 and not sphere:
        return r - radius, 1.0, 0.0
    d = math.sqrt(r * r + up * up)
    return d - radius, r / d, up / d


@njit(inline="always")
def resist(depth, speed, forces):
    """Upward force on the projectile, beside the dust's stress. depth, speed : downwards; forces : side and shaft's drag per
    immersed length, pull, drag with v, with v², film, the depth that it reaches to. On the way back up friction and drags act
    downwards; the film is broken."""
    if depth <= 0.0:
        return 0.0
    if speed <= 0.0:
        back = -speed
        rubbing = forces[0] * min(back / SLIP, 1.0) + forces[1] * back * back
        return forces[2] - rubbing * depth - (forces[3] + forces[4] * back) * back
    moving = (forces[0] + forces[1] * speed * speed) * depth + (forces[3] + forces[4] * speed) * speed
    if depth < forces[6]:
        moving += forces[5]
    return moving + forces[2]


@njit(cache=True)
def advance(r, z, cells, law, damping, body, forces, gravity, courant, end, after, curve):
    """Run from contact to the first v = 0, or ``after`` times as long, to ``end`` (s) at most. The top row of nodes may not enter
    the projectile.

    body : radius, mass per radian, speed downwards, 1 for a sphere or 0 for the end of a rod, share of its mass that it gathers
    per radius of depth
    forces : (7,) as in ``resist``, per radian
    curve : (k, 4) time, height of the tip, its velocity, force on it per radian, a row a step
    Returns steps (negative where a cell turned over), steps to the first v = 0, energies (8,) per radian: stress work, viscous,
    hourglass, contact, kinetic of the dust, potential energy it gained, work of the forces, what gathered mass takes.
    """
    radius, alone, speed, sphere, gathered = body[0], body[1], body[2], body[3] > 0.5, body[4]
    shape = r.shape
    u, v, force_r, force_z = np.zeros(shape), np.zeros(shape), np.zeros(shape), np.zeros(shape)
    nodes = np.zeros(shape)
    for i in range(cells.shape[0]):
        for j in range(cells.shape[1]):
            quarter = 0.25 * cells[i, j, MASS]
            nodes[i, j] += quarter
            nodes[i + 1, j] += quarter
            nodes[i, j + 1] += quarter
            nodes[i + 1, j + 1] += quarter
    last, floor = shape[0] - 1, shape[1] - 1
    spent, energies = np.zeros(3), np.zeros(8)
    crossing = load_nodes(r, z, u, v, 0.0, cells, law, damping, force_r, force_z, spent)
    tip, falling, time, steps, stopped, mass = 0.0, -speed, 0.0, 0, 0, alone
    curve[0] = 0.0, 0.0, -speed, 0.0
    law = law.copy()
    while time < end and steps < curve.shape[0] - 1:
        dt = courant * crossing
        push, node_work = 0.0, 0.0
        for i in range(shape[0]):
            for j in range(floor):  # the floor holds its nodes
                u_new = u[i, j] + dt * force_r[i, j] / nodes[i, j]
                if i == 0 or i == last:
                    u_new = 0.0
                v_new = v[i, j] + dt * (force_z[i, j] / nodes[i, j] - gravity)
                if j == 0:
                    depth, nr, nz = find_surface(
                        r[i, j] + dt * u_new, z[i, j] + dt * v_new, tip + dt * falling, radius, sphere
                    )
                    if depth < 0.0:
                        change = -depth / dt  # along the normal, to the surface by the end of the step
                        u_new += change * nr
                        v_new += change * nz
                        push -= nodes[i, j] * change * nz
                        mean = (u[i, j] + u_new) * nr + (v[i, j] + v_new) * nz
                        node_work += 0.5 * nodes[i, j] * change * mean
                energies[5] += nodes[i, j] * gravity * dt * v_new
                r[i, j] += dt * u_new
                z[i, j] += dt * v_new
                u[i, j], v[i, j] = u_new, v_new
        held = resist(-tip, -falling, forces) * dt
        if gathered == 0.0:
            slowed = falling + (push + held) / mass - gravity * dt
        else:  # momentum is kept
            heavier = max(mass, alone * (1.0 + gathered * -tip / radius))
            slowed = (mass * falling + push + held) / heavier - gravity * dt
            energies[7] += 0.5 * (heavier - mass) * falling * slowed
            energies[7] += 0.5 * (heavier - alone) * gravity * dt * (falling + slowed)
            mass = heavier
        energies[3] -= node_work + 0.5 * push * (falling + slowed)
        energies[6] -= 0.5 * held * (falling + slowed)
        tip += dt * slowed
        falling = slowed
        time += dt
        steps += 1
        curve[steps] = time, tip, falling, push / dt
        law[18] = time
        crossing = load_nodes(r, z, u, v, dt, cells, law, damping, force_r, force_z, spent)
        if crossing < 0.0:
            return -steps, stopped, energies
        if stopped == 0 and falling >= 0.0:
            stopped, end = steps, after * time
    energies[:3] = spent
    energies[4] = 0.5 * np.sum(nodes * (u * u + v * v))
    return steps, stopped, energies
