"""One drop by material points: an r-z grid with quadratic B-splines, ring masses, a symmetric axis.

Velocities go to the grid with their gradient (APIC: Jiang et al. 2015). A point gets the grid's new velocity back, and keeps the
share ``own`` of what it had beyond the grid's old one (0: APIC; 1: the increment alone, as in FLIP; between: Fei et al. 2021).
APIC alone takes a share of the motion with every step, so that its depths fall with the time step.

A rigid projectile on the axis (the hemispherical end of a rod, or a sphere) is a condition on the grid's nodes
inside it: they may move away along its normal, never into it. The impulses of that condition are the force on it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from benchmarks.material_points.dust import find_unstressed, look_up

# columns of the points' array
R, Z, VR, VZ, CRR, CRZ, CZR, CZZ, SRR, SZZ, STT, SRZ, PHI, PHI0, PHI_I, MASS, PRESSURE, STRENGTH, SLIP = (
    range(19)
)
COLUMNS = 19


@njit(inline="always", fastmath=True)
def spline(x):
    """Weights of the quadratic B-spline at three nodes; x = distance to the first, in cells (0.5 to 1.5)."""
    return 0.5 * (1.5 - x) ** 2, 0.75 - (x - 1.0) ** 2, 0.5 * (x - 0.5) ** 2


@njit(inline="always", fastmath=True)
def reach_nodes(r, z, z0, inv_h):
    """First of the three nodes along r and z, distances to them in cells, weights, and slopes of the weights (1/m)."""
    x = r * inv_h
    y = (z - z0) * inv_h
    i0 = math.floor(x - 0.5)
    j0 = math.floor(y - 0.5)
    fx = x - i0
    fy = y - j0
    gx = ((fx - 1.5) * inv_h, -2.0 * (fx - 1.0) * inv_h, (fx - 0.5) * inv_h)
    gy = ((fy - 1.5) * inv_h, -2.0 * (fy - 1.0) * inv_h, (fy - 0.5) * inv_h)
    return i0, j0, fx, fy, spline(fx), spline(fy), gx, gy


@njit(inline="always", fastmath=True)
def surface_of(r, z, tip, radius, is_sphere):
    """Signed distance to the projectile's surface and the outward normal there; its lowest point is at ``tip``."""
    up = z - (tip + radius)
    if up > 0.0 and not is_sphere:
        return r - radius, 1.0, 0.0
    d = math.sqrt(r * r + up * up)
    if d < 1e-12:
        return -radius, 0.0, -1.0
    return d - radius, r / d, up / d


@njit(fastmath=True, cache=True)
def advance(
    points,
    h,
    z_floor,
    shape,
    sigma_table,
    tensile_table,
    law,
    body,
    forces,
    courant,
    end,
    stop_factor,
    curve,
    interval,
    own,
):
    """Run from contact to ``stop_factor`` times the stopping time (or ``end``, s).

    law: k0, shear_to_bulk, shear_factor, eta, rate_n, gas pressure, solid density, gravity,
         strength lost by shear, shear that halves what can be lost, hardening, rate with Y.
    body: radius, mass, speed downwards, is_sphere, contact friction, gap (cells), height of the tip at the start (m).
    forces: side friction N/m, drag of the shaft kg/m^2 per immersed metre, constant pull N once in contact,
         dust accreted (share of the mass per radius of depth).
    own: share of a point's velocity beyond the grid's that it keeps.
    curve: (n, 3) time, depth, speed; written every ``interval``. Returns entries written, steps, stopping time, depth then.
    """
    k0, shear_to_bulk, shear_factor, eta, rate_n, gas, solid, gravity = law[:8]
    weakening, weakening_shear, hardening, rate_in_shear = law[8:12]
    radius, mass0, speed, is_sphere_f, friction, gap, tip = body
    side, shaft_drag, pull, accreted = forces
    is_sphere = is_sphere_f > 0.5
    nr, nz = shape
    n = points.shape[0]
    inv_h = 1.0 / h
    m = np.zeros((nr, nz))
    pr = np.zeros((nr, nz))
    pz = np.zeros((nr, nz))
    qr = np.zeros((nr, nz))
    qz = np.zeros((nr, nz))
    k_floor = 2  # nodes at and below this index do not move
    z0 = z_floor - k_floor * h
    vb = -math.sqrt(speed * speed - 2.0 * gravity * tip)
    time = -tip / speed
    written = 0
    steps = 0
    stopping_time = -1.0
    stopping_depth = 0.0
    c2_max = 0.0
    for k in range(n):
        c2 = k0 * (points[k, PHI0] / 0.15) ** 4 * (1.0 + 4.0 / 3.0 * shear_to_bulk) / (points[k, PHI] * solid)
        c2_max = max(c2_max, c2)
    next_out = time
    lightest = 1e-9 * 300.0 * 2.0 * math.pi * h**3
    while time < end:
        dt = courant * h / (math.sqrt(c2_max) + speed)
        if time >= next_out and written < curve.shape[0]:
            curve[written, 0] = time
            curve[written, 1] = -tip
            curve[written, 2] = -vb
            written += 1
            next_out += interval
        # points to grid
        m[:] = 0.0
        pr[:] = 0.0
        pz[:] = 0.0
        qr[:] = 0.0
        qz[:] = 0.0
        for k in range(n):
            p = points[k]
            i0, j0, fx, fy, wx, wy, gx, gy = reach_nodes(p[R], p[Z], z0, inv_h)
            if i0 + 3 >= nr or j0 < 0 or j0 + 2 >= nz:
                continue
            mp = p[MASS]
            v_dt = dt * mp / (p[PHI] * solid)
            srr = v_dt * (p[SRR] - p[PRESSURE])
            szz = v_dt * (p[SZZ] - p[PRESSURE])
            stt = v_dt * (p[STT] - p[PRESSURE]) / p[R]
            srz = v_dt * p[SRZ]
            for a in range(3):
                dx = (a - fx) * h
                for b in range(3):
                    dy = (b - fy) * h
                    w = wx[a] * wy[b]
                    dwx = gx[a] * wy[b]
                    dwy = wx[a] * gy[b]
                    i = i0 + a + 1  # one column left of the axis
                    j = j0 + b
                    m[i, j] += mp * w
                    qr[i, j] += mp * w * (p[VR] + p[CRR] * dx + p[CRZ] * dy)
                    qz[i, j] += mp * w * (p[VZ] + p[CZR] * dx + p[CZZ] * dy)
                    pr[i, j] -= srr * dwx + srz * dwy + stt * w
                    pz[i, j] -= srz * dwx + szz * dwy
        # the column left of the axis is the image of the one right of it
        for j in range(nz):
            m[2, j] += m[0, j]
            pr[2, j] -= pr[0, j]
            pz[2, j] += pz[0, j]
            qr[2, j] -= qr[0, j]
            qz[2, j] += qz[0, j]
        impulse = 0.0
        for i in range(1, nr):
            r = (i - 1) * h
            for j in range(nz):
                mi = m[i, j]
                if mi < lightest:
                    pr[i, j] = 0.0
                    pz[i, j] = 0.0
                    qr[i, j] = 0.0
                    qz[i, j] = 0.0
                    continue
                qr[i, j] /= mi
                qz[i, j] /= mi
                if i == 1:
                    qr[i, j] = 0.0
                u = qr[i, j] + pr[i, j] / mi
                v = qz[i, j] + pz[i, j] / mi - gravity * dt
                if i == 1:
                    u = 0.0
                z = z0 + j * h
                if z > tip - h:
                    distance, nx, ny = surface_of(r, z, tip, radius, is_sphere)
                    if distance < gap * h:
                        approach = u * nx + (v - vb) * ny
                        if approach < 0.0:
                            v_before = v
                            u -= approach * nx
                            v -= approach * ny
                            if friction > 0.0:
                                slide = math.sqrt(u * u + (v - vb) * (v - vb))
                                if slide > 0.0:
                                    keep = max(0.0, 1.0 + friction * approach / slide)
                                    u *= keep
                                    v = vb + (v - vb) * keep
                            if i == 1:
                                u = 0.0
                            impulse -= mi * (v - v_before)
                if j <= k_floor:
                    u = 0.0
                    v = 0.0
                if i >= nr - 3:
                    u = 0.0
                pr[i, j] = u
                pz[i, j] = v
        for j in range(nz):
            pr[0, j] = -pr[2, j]
            pz[0, j] = pz[2, j]
            qr[0, j] = -qr[2, j]
            qz[0, j] = qz[2, j]
        # the projectile
        depth = max(-tip, 0.0)
        mass = mass0 * (1.0 + accreted * depth / radius)
        outside = 0.0
        if vb < 0.0:
            outside = (side + shaft_drag * vb * vb) * depth
        outside += pull if depth > 0.0 else 0.0
        vb_new = vb + impulse / mass - gravity * dt + outside * dt / mass
        if stopping_time < 0.0 and vb_new >= 0.0 and vb < 0.0:
            stopping_time = time + dt * vb / (vb - vb_new)
            stopping_depth = -(tip + 0.5 * (stopping_time - time) * vb)
        # grid to points
        c2_max = 0.0
        for k in range(n):
            p = points[k]
            i0, j0, fx, fy, wx, wy, gx, gy = reach_nodes(p[R], p[Z], z0, inv_h)
            if i0 + 3 >= nr or j0 < 0 or j0 + 2 >= nz:
                continue
            u_old = v_old = u = v = crr = crz = czr = czz = lrr = lrz = lzr = lzz = 0.0
            for a in range(3):
                dx = (a - fx) * h
                for b in range(3):
                    dy = (b - fy) * h
                    w = wx[a] * wy[b]
                    i = i0 + a + 1
                    j = j0 + b
                    ui = pr[i, j]
                    vi = pz[i, j]
                    u += w * ui
                    v += w * vi
                    u_old += w * qr[i, j]
                    v_old += w * qz[i, j]
                    crr += w * ui * dx
                    crz += w * ui * dy
                    czr += w * vi * dx
                    czz += w * vi * dy
                    lrr += gx[a] * wy[b] * ui
                    lrz += wx[a] * gy[b] * ui
                    lzr += gx[a] * wy[b] * vi
                    lzz += wx[a] * gy[b] * vi
            to_c = 4.0 * inv_h * inv_h
            p[CRR] = crr * to_c
            p[CRZ] = crz * to_c
            p[CZR] = czr * to_c
            p[CZZ] = czz * to_c
            p[VR] = u + own * (p[VR] - u_old)
            p[VZ] = v + own * (p[VZ] - v_old)
            hoop = u / p[R]
            p[R] = abs(p[R] + dt * u)
            p[Z] += dt * v
            div = lrr + lzz + hoop
            # stress
            phi = p[PHI] * math.exp(-dt * div)
            phi = min(phi, 0.74)
            p[PHI] = phi
            phi0 = p[PHI0]
            k_bulk = k0 * (phi0 / 0.15) ** 4
            quasi_static = p[STRENGTH] * look_up(sigma_table, phi)
            if weakening > 0.0:
                quasi_static *= 1.0 - weakening * (1.0 - 2.0 ** (-p[SLIP] / weakening_shear))
            strength = quasi_static
            if eta > 0.0 and div < 0.0:
                strength *= 1.0 + eta * (-div) ** rate_n
            tensile = look_up(tensile_table, phi)
            pressure = k_bulk * (phi / phi0 - 1.0)
            if pressure > strength:
                pressure = strength
                phi0 = find_unstressed(phi, pressure, phi0, k0)
            elif pressure < -tensile:
                pressure = -tensile
                phi0 = find_unstressed(phi, pressure, phi0, k0)
            p[PHI0] = phi0
            k_bulk = k0 * (phi0 / 0.15) ** 4
            mu = shear_to_bulk * k_bulk
            spin = 0.5 * (lrz - lzr)
            err = lrr - div / 3.0
            ezz = lzz - div / 3.0
            ett = hoop - div / 3.0
            erz = 0.5 * (lrz + lzr)
            srr = p[SRR] + dt * (2.0 * mu * err + 2.0 * spin * p[SRZ])
            szz = p[SZZ] + dt * (2.0 * mu * ezz - 2.0 * spin * p[SRZ])
            stt = p[STT] + dt * 2.0 * mu * ett
            srz = p[SRZ] + dt * (2.0 * mu * erz + spin * (p[SZZ] - p[SRR]))
            q = math.sqrt(1.5 * (srr * srr + szz * szz + stt * stt + 2.0 * srz * srz))
            base = strength if rate_in_shear > 0.5 else quasi_static
            y_shear = shear_factor * math.sqrt(base * tensile)
            if hardening != 0.0:
                y_shear *= 1.0 + hardening * p[SLIP]
            if q > y_shear:
                p[SLIP] += (q - y_shear) / (3.0 * mu)
                f = y_shear / q
                srr *= f
                szz *= f
                stt *= f
                srz *= f
            p[SRR] = srr
            p[SZZ] = szz
            p[STT] = stt
            p[SRZ] = srz
            if gas > 0.0:
                pressure += gas * ((1.0 - p[PHI_I]) / (1.0 - phi) - 1.0)
                k_bulk += gas * phi / (1.0 - phi)
            p[PRESSURE] = pressure
            c2_max = max(c2_max, (k_bulk * phi / phi0 + 4.0 / 3.0 * mu) / (phi * solid))
        tip += dt * vb_new
        vb = vb_new
        time += dt
        steps += 1
        if stopping_time > 0.0 and time > stop_factor * stopping_time:
            break
    curve[min(written, curve.shape[0] - 1), 0] = time
    curve[min(written, curve.shape[0] - 1), 1] = -tip
    curve[min(written, curve.shape[0] - 1), 2] = -vb
    written = min(written + 1, curve.shape[0])
    return written, steps, stopping_time, stopping_depth
