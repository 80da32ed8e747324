"""The two sums over neighbours. Arrays and floats only: no material law ever enters here.

Kernel: Wendland C2 in the plane, W(q) = 7/(4π h²) (1 - q/2)⁴ (1 + 2q), q = |x|/h < 2 (Wendland 1995; Dehnen & Aly 2012),
whose gradient is F(q) x with F = -35/(4π h⁴) (1 - q/2)³: no division by the distance, no branch.
"""

from __future__ import annotations

import math

from .._jit import compiled
from .lines import ROOM, read_eight, read_five

GRADIENT_NORM = -35.0 / (4.0 * math.pi)


@compiled
def sum_gradients(low, high, rows, lists, lines, h):
    """Raw gradient sums at particles low..high-1: Σ A_j (x_j - x_i) ∇W into g.. and Σ A_j (v_j - v_i) ∇W into l.. .

    l<a><b> is the derivative of velocity component a along b before renormalisation. front: lines (x, z, u, w, A, ...);
    nearby: (8, ROOM), what is worked on.
    """
    x, z, vx, vz, neighbour = rows.x, rows.z, rows.u, rows.w, lists.neighbour
    gxx, gxz, gzz, lxx, lxz, lzx, lzz = rows.gxx, rows.gxz, rows.gzz, rows.lxx, rows.lxz, rows.lzx, rows.lzz
    start, stop, front, near = lists.start, lists.start[1:], lines.front, lines.nearby
    inverse_2h = 0.5 / h
    norm = GRADIENT_NORM / h**4
    for i in range(low, high):
        xi, zi, ui, wi = x[i], z[i], vx[i], vz[i]
        sxx = sxz = szz = 0.0
        dxx = dxz = dzx = dzz = 0.0
        first = start[i]
        while first < stop[i]:
            count = min(stop[i] - first, ROOM)
            for k in range(0, count, 8):
                read_five(front, neighbour, first + k, near, k)
            for k in range(count):
                dx = xi - near[0, k]
                dz = zi - near[1, k]
                s = max(0.0, 1.0 - math.sqrt(dx * dx + dz * dz) * inverse_2h)
                f = s * s * s * near[4, k]
                fx = f * dx
                fz = f * dz
                sxx += dx * fx
                sxz += dx * fz
                szz += dz * fz
                du = near[2, k] - ui
                dw = near[3, k] - wi
                dxx += du * fx
                dxz += du * fz
                dzx += dw * fx
                dzz += dw * fz
            first += count
        gxx[i] = -norm * sxx
        gxz[i] = -norm * sxz
        gzz[i] = -norm * szz
        lxx[i] = norm * dxx
        lxz[i] = norm * dxz
        lzx[i] = norm * dzx
        lzz[i] = norm * dzz


@compiled
def sum_forces(low, high, rows, lists, lines, numbers):
    """Force on particles low..high-1 (per radian, or per metre in the plane), and the heating by artificial viscosity.

    f_i = A_i Σ_j A_j (M_i + M_j - q_ij) ∇W, with M = ring radius · stress · renormalisation, so that Σ f·v is minus the
    power of the stresses on the very gradients that sum_gradients gives. q_ij acts on that part of the velocity
    difference of a pair that the particles' own linear velocity field (share ``affine``) does not explain.
    weight = density times ring radius, shear = lxz + lzx. front: lines (x, z, u, w, A, Mzz, s, d); back: lines
    (weight, sound, lxx, shear, lzz, Mxx, Mxz, Mzx); nearby, beyond: (8, ROOM), what is worked on.

    exchange: rate of growth (1/s) of each particle's volume by what it exchanges with its neighbours, so that a scalar s
    evens out with diffusivity d (rows compaction and diffusivity): V_i exchange_i = - 2 Σ (d_i + d_j) A_i A_j F
    (s_i - s_j)(weight_i + weight_j)/(s_i + s_j)², antisymmetric in i and j. So masses and the sum of volumes stay.

    hold_apart: empty, or one entry to switch on artificial stress: the tension of a pair along its own line, times
    artificial_stress times (W/W(spacing))⁴, holds the two apart (after Monaghan 2000, Gray et al. 2001, who take it from
    each particle's principal stresses). It does no work in the book of heat.
    """
    h = numbers.h
    inverse_2h = 0.5 / h
    norm = GRADIENT_NORM / h**4
    floor = 0.01 * h * h
    alpha, beta, affine = numbers.alpha, numbers.beta, numbers.affine
    hold_apart, share, per_kernel = numbers.hold_apart, numbers.artificial_stress, numbers.per_kernel
    x, z, vx, vz, area, weight, sound, density = (
        rows.x,
        rows.z,
        rows.u,
        rows.w,
        rows.area,
        rows.weight,
        rows.sound,
        rows.density,
    )
    lxx, shear, lzz, mxx, mxz, mzx, mzz = (
        rows.lxx,
        rows.shear,
        rows.lzz,
        rows.mxx,
        rows.mxz,
        rows.mzx,
        rows.mzz,
    )
    compaction, diffusivity, exchange = rows.compaction, rows.diffusivity, rows.exchange
    fx_out, fz_out, heat = rows.fx, rows.fz, rows.heat
    start, stop, neighbour = lists.start, lists.start[1:], lists.neighbour
    front, back, near, beyond = lines.front, lines.back, lines.nearby, lines.beyond
    half = 0.5 * affine
    linear = -0.25 * alpha * h
    square = -0.5 * beta * h * h
    for i in range(low, high):
        xi, zi, ui, wi = x[i], z[i], vx[i], vz[i]
        axx, axz, azx, azz = mxx[i], mxz[i], mzx[i], mzz[i]
        ixx, ixz, izz = lxx[i], shear[i], lzz[i]
        ci, wti = sound[i], weight[i]
        sx = sz = 0.0
        power = 0.0
        gain = 0.0
        si, di = compaction[i], diffusivity[i]
        first = start[i]
        while first < stop[i]:
            count = min(stop[i] - first, ROOM)
            for k in range(0, count, 8):
                read_eight(front, neighbour, first + k, near, k)
                read_eight(back, neighbour, first + k, beyond, k)
            for k in range(count):
                dx = xi - near[0, k]
                dz = zi - near[1, k]
                d2 = dx * dx + dz * dz
                s = max(0.0, 1.0 - math.sqrt(d2) * inverse_2h)
                f = s * s * s * near[4, k]
                fx = f * dx
                fz = f * dz
                du = ui - near[2, k]
                dw = wi - near[3, k]
                approach = du * dx + dw * dz
                jump = approach - half * (
                    ((ixx + beyond[2, k]) * dx + (ixz + beyond[3, k]) * dz) * dx
                    + (izz + beyond[4, k]) * dz * dz
                )
                mu = jump / (d2 + floor)
                q = (wti + beyond[0, k]) * (linear * (ci + beyond[1, k]) + square * abs(mu)) * mu
                power += q * f * approach
                both = si + near[6, k]
                gain += (di + near[7, k]) * (si - near[6, k]) * (wti + beyond[0, k]) / (both * both) * f
                if len(hold_apart) > 0:
                    skew = axz + azx + beyond[6, k] + beyond[7, k]
                    pull = ((axx + beyond[5, k]) * dx + skew * dz) * dx + (azz + near[5, k]) * dz * dz
                    pull = max(pull / (d2 + floor), 0.0)
                    s2 = s * s
                    g = s2 * s2 * (5.0 - 4.0 * s) * per_kernel
                    g *= g
                    q += share * pull * g * g
                sx += (axx + beyond[5, k] - q) * fx + (axz + beyond[6, k]) * fz
                sz += (azx + beyond[7, k]) * fx + (azz + near[5, k] - q) * fz
            first += count
        fx_out[i] = norm * area[i] * sx
        fz_out[i] = norm * area[i] * sz
        exchange[i] = -2.0 * norm * gain * density[i] / wti
        heat[i] = 0.5 * norm * area[i] * power
