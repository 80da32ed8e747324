"""Between the two sums over neighbours: renormalised velocity gradients, the stress they carry, mirror images.

The gradient is exact for linear fields (Randles & Libersky 1996; Bonet & Lok 1999) and the force is its adjoint: the power of
the forces is minus the power of the stresses on those very gradients, in the plane and in rings alike, hoop stress
included. So energy balances without any scaling of the hoop term.
"""

from __future__ import annotations

import math

from ._jit import compiled

SMALLEST_EIGENVALUE = 0.3  # of the moment matrix, below which it is lifted: a lone particle has no gradient


@compiled
def mirror_axis(n, count, source, row, sign):
    """Images of ``row`` across the axis, behind the first n points."""
    for k in range(count):
        row[n + k] = sign * row[source[k]]


@compiled
def renormalise(n, gxx, gxz, gzx, gzz, lxx, lxz, lzx, lzz):
    """Invert the moment matrices in place (g becomes B) and apply them to the raw velocity gradients."""
    for i in range(n):
        a, b, c = gxx[i], gxz[i], gzz[i]
        low = 0.5 * (a + c) - math.sqrt(0.25 * (a - c) ** 2 + b * b)
        if low < SMALLEST_EIGENVALUE:
            lift = SMALLEST_EIGENVALUE - low
            a += lift
            c += lift
        scale = 1.0 / (a * c - b * b)
        ia, ib, ic = c * scale, -b * scale, a * scale
        gxx[i], gxz[i], gzx[i], gzz[i] = ia, ib, ib, ic
        x0, x1, y0, y1 = lxx[i], lxz[i], lzx[i], lzz[i]
        lxx[i] = x0 * ia + x1 * ib
        lxz[i] = x0 * ib + x1 * ic
        lzx[i] = y0 * ia + y1 * ib
        lzz[i] = y0 * ib + y1 * ic


@compiled
def carry_stress(n, ring, pressure, sxx, szz, sxz, bxx, bxz, bzx, bzz, mxx, mxz, mzx, mzz):
    """M = ring radius · stress · B, what each particle brings into the sum of forces."""
    for i in range(n):
        a = (sxx[i] - pressure[i]) * ring[i]
        c = (szz[i] - pressure[i]) * ring[i]
        b = sxz[i] * ring[i]
        mxx[i] = a * bxx[i] + b * bzx[i]
        mxz[i] = a * bxz[i] + b * bzz[i]
        mzx[i] = b * bxx[i] + c * bzx[i]
        mzz[i] = b * bxz[i] + c * bzz[i]


@compiled
def deform(n, dt, lxx, lxz, lzx, lzz, dxx, dxz, dzx, dzz):
    """Deformation gradient in the plane, dD/dt = L D: tells how thin the dust beside the projectile has become."""
    for i in range(n):
        a, b, c, d = dxx[i], dxz[i], dzx[i], dzz[i]
        dxx[i] = a + dt * (lxx[i] * a + lxz[i] * c)
        dxz[i] = b + dt * (lxx[i] * b + lxz[i] * d)
        dzx[i] = c + dt * (lzx[i] * a + lzz[i] * c)
        dzz[i] = d + dt * (lzx[i] * b + lzz[i] * d)
