"""Between the two sums over neighbours: renormalised velocity gradients, the stress they carry, mirror images.

The gradient is exact for linear fields (Randles & Libersky 1996; Bonet & Lok 1999) and the force is its adjoint: the power of
the forces is minus the power of the stresses on those very gradients, in the plane and in rings alike, hoop stress
included. So energy balances without any scaling of the hoop term.
"""

from __future__ import annotations

import math

from ._jit import compiled

SMALLEST_EIGENVALUE = 0.3  # of the moment matrix, below which it is lifted: a lone particle has no gradient

HOOP_STIFFNESS = 0.6  # a in bound_step
FEW = 1.8  # half trace of B from which on a particle has so few neighbours that the step is shortened


@compiled
def mirror_axis(n, count, source, row, sign):
    """Images of ``row`` across the axis, behind the first n points."""
    for k in range(count):
        row[n + k] = sign * row[source[k]]


@compiled
def renormalise(low, high, gxx, gxz, gzz, lxx, lxz, lzx, lzz):
    """Invert the symmetric moment matrices in place (g becomes B) and apply them to the raw velocity gradients."""
    for i in range(low, high):
        a, b, c = gxx[i], gxz[i], gzz[i]
        smallest = 0.5 * (a + c) - math.sqrt(0.25 * (a - c) ** 2 + b * b)
        lift = max(SMALLEST_EIGENVALUE - smallest, 0.0)
        a += lift
        c += lift
        scale = 1.0 / (a * c - b * b)
        ia, ib, ic = c * scale, -b * scale, a * scale
        x0, x1, y0, y1 = lxx[i], lxz[i], lzx[i], lzz[i]
        gxx[i], gxz[i], gzz[i] = ia, ib, ic
        lxx[i] = x0 * ia + x1 * ib
        lxz[i] = x0 * ib + x1 * ic
        lzx[i] = y0 * ia + y1 * ib
        lzz[i] = y0 * ib + y1 * ic


@compiled
def carry_stress(
    low, high, ring, pressure, sxx, szz, sxz, bxx, bxz, bzz, lxz, lzx, mxx, mxz, mzx, mzz, shear
):
    """M = ring radius · stress · B, what each particle brings into the sum of forces, and the shear rate lxz + lzx."""
    for i in range(low, high):
        a = (sxx[i] - pressure[i]) * ring[i]
        c = (szz[i] - pressure[i]) * ring[i]
        b = sxz[i] * ring[i]
        mxx[i] = a * bxx[i] + b * bxz[i]
        mxz[i] = a * bxz[i] + b * bzz[i]
        mzx[i] = b * bxx[i] + c * bxz[i]
        mzz[i] = b * bxz[i] + c * bzz[i]
        shear[i] = lxz[i] + lzx[i]


@compiled
def bound_step(low, high, axisymmetric, h, ring, sound, bxx, bzz, worst):
    """The larger of ``worst`` and of c² (1 + (a h/r)²) max(1, tr B / (2 FEW))², m²/s², over particles low..high-1.

    Near the axis the hoop strain v/r is stiffer than any gradient, and so is the gradient of a particle with few neighbours: both
    ask for a shorter step.
    """
    reach = HOOP_STIFFNESS * h if axisymmetric else 0.0
    for i in range(low, high):
        ratio = reach / ring[i]
        few = max((bxx[i] + bzz[i]) * (0.5 / FEW), 1.0)
        worst = max(worst, (sound[i] * few) ** 2 * (1.0 + ratio * ratio))
    return worst


@compiled
def deform(low, high, dt, lxx, lxz, lzx, lzz, dxx, dxz, dzx, dzz):
    """Deformation gradient in the plane, dD/dt = L D: tells how thin the dust beside the projectile has become."""
    for i in range(low, high):
        a, b, c, d = dxx[i], dxz[i], dzx[i], dzz[i]
        dxx[i] = a + dt * (lxx[i] * a + lxz[i] * c)
        dxz[i] = b + dt * (lxx[i] * b + lxz[i] * d)
        dzx[i] = c + dt * (lzx[i] * a + lzz[i] * c)
        dzz[i] = d + dt * (lzx[i] * b + lzz[i] * d)
