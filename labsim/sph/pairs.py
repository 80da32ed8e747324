"""The two sums over neighbours. Arrays and floats only: no material law ever enters here.

Kernel: Wendland C2 in the plane, W(q) = 7/(4π h²) (1 - q/2)⁴ (1 + 2q), q = |x|/h < 2 (Wendland 1995; Dehnen & Aly 2012),
whose gradient is F(q) x with F = -35/(4π h⁴) (1 - q/2)³: no division by the distance, no branch.
"""

from __future__ import annotations

import math

from ._jit import compiled

GRADIENT_NORM = -35.0 / (4.0 * math.pi)


@compiled
def sum_gradients(n, x, z, vx, vz, area, start, neighbour, h, gxx, gxz, gzz, lxx, lxz, lzx, lzz):
    """Raw gradient sums at particles 0..n-1: Σ A_j (x_j - x_i) ∇W into g.. and Σ A_j (v_j - v_i) ∇W into l.. .

    l<a><b> is the derivative of velocity component a along b before renormalisation.
    """
    inverse_2h = 0.5 / h
    norm = GRADIENT_NORM / h**4
    for i in range(n):
        xi, zi, ui, wi = x[i], z[i], vx[i], vz[i]
        sxx = sxz = szz = 0.0
        dxx = dxz = dzx = dzz = 0.0
        for k in range(start[i], start[i + 1]):
            j = neighbour[k]
            dx = xi - x[j]
            dz = zi - z[j]
            s = max(0.0, 1.0 - math.sqrt(dx * dx + dz * dz) * inverse_2h)
            f = norm * s * s * s * area[j]
            fx = f * dx
            fz = f * dz
            sxx -= dx * fx
            sxz -= dx * fz
            szz -= dz * fz
            du = vx[j] - ui
            dw = vz[j] - wi
            dxx += du * fx
            dxz += du * fz
            dzx += dw * fx
            dzz += dw * fz
        gxx[i] = sxx
        gxz[i] = sxz
        gzz[i] = szz
        lxx[i] = dxx
        lxz[i] = dxz
        lzx[i] = dzx
        lzz[i] = dzz


@compiled
def sum_forces(
    n, x, z, vx, vz, area, weight, sound, lxx, lxz, lzx, lzz, mxx, mxz, mzx, mzz, start, neighbour, h,
    alpha, beta, affine, fx_out, fz_out, heat,
):  # fmt: skip
    """Force on particles 0..n-1 (per radian, or per metre in the plane), and the heating by artificial viscosity.

    f_i = A_i Σ_j A_j (M_i + M_j - q_ij) ∇W, with M = ring radius · stress · renormalisation, so that Σ f·v is minus the
    power of the stresses on the very gradients that sum_gradients gives. q_ij acts on that part of the velocity
    difference of a pair that the particles' own linear velocity field (share ``affine``) does not explain.
    weight = density times ring radius.
    """
    inverse_2h = 0.5 / h
    norm = GRADIENT_NORM / h**4
    floor = 0.01 * h * h
    for i in range(n):
        xi, zi, ui, wi = x[i], z[i], vx[i], vz[i]
        axx, axz, azx, azz = mxx[i], mxz[i], mzx[i], mzz[i]
        ixx, ixz, izx, izz = lxx[i], lxz[i], lzx[i], lzz[i]
        ci, wti = sound[i], weight[i]
        sx = sz = 0.0
        power = 0.0
        for k in range(start[i], start[i + 1]):
            j = neighbour[k]
            dx = xi - x[j]
            dz = zi - z[j]
            d2 = dx * dx + dz * dz
            s = max(0.0, 1.0 - math.sqrt(d2) * inverse_2h)
            f = norm * s * s * s * area[j]
            fx = f * dx
            fz = f * dz
            du = ui - vx[j]
            dw = wi - vz[j]
            jump = du * dx + dw * dz
            jump -= (
                affine
                * 0.5
                * (
                    (ixx + lxx[j]) * dx * dx
                    + (ixz + lxz[j] + izx + lzx[j]) * dx * dz
                    + (izz + lzz[j]) * dz * dz
                )
            )
            mu = h * jump / (d2 + floor)
            q = 0.5 * (wti + weight[j]) * (-alpha * 0.5 * (ci + sound[j]) - beta * abs(mu)) * mu
            sx += (axx + mxx[j] - q) * fx + (axz + mxz[j]) * fz
            sz += (azx + mzx[j]) * fx + (azz + mzz[j] - q) * fz
            power += q * (fx * du + fz * dw)
        fx_out[i] = area[i] * sx
        fz_out[i] = area[i] * sz
        heat[i] = 0.5 * area[i] * power
