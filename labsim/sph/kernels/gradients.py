"""Between the two sums over neighbours: renormalised velocity gradients, the stress they carry, mirror images.

The gradient is exact for linear fields (Randles & Libersky 1996; Bonet & Lok 1999) and the force is its adjoint: the power of
the forces is minus the power of the stresses on those very gradients, in the plane and in rings alike, hoop stress
included. So energy balances without any scaling of the hoop term.
"""

from __future__ import annotations

import math

from .._jit import compiled

SMALLEST_EIGENVALUE = 0.3  # of the moment matrix, below which it is lifted: a lone particle has no gradient

HOOP_STIFFNESS = 0.6  # a in bound_step
FEW = 1.8  # half trace of B from which on a particle has so few neighbours that the step is shortened


@compiled
def mirror_axis(n, count, source, row, sign):
    """Images of ``row`` across the axis, behind the first n points."""
    for k in range(count):
        row[n + k] = sign * row[source[k]]


@compiled
def renormalise(low, high, s):
    """Invert the symmetric moment matrices in place (g becomes B) and apply them to the raw velocity gradients."""
    gxx, gxz, gzz, lxx, lxz, lzx, lzz = s.gxx, s.gxz, s.gzz, s.lxx, s.lxz, s.lzx, s.lzz
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
def carry_stress(low, high, s):
    """M = ring radius · stress · B, what each particle brings into the sum of forces, and the shear rate lxz + lzx."""
    ring, pressure, sxx, szz, sxz, lxz, lzx = s.ring, s.pressure, s.sxx, s.szz, s.sxz, s.lxz, s.lzx
    bxx, bxz, bzz, mxx, mxz, mzx, mzz, shear = s.gxx, s.gxz, s.gzz, s.mxx, s.mxz, s.mzx, s.mzz, s.shear
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
def find_fronts(low, high, axisymmetric, front, h, s):
    """Take the linear velocity field (lxx, lzz, shear = lxz + lzx) away where the dust is pressed together along one line.

    Viscosity acts on what particles' linear fields leave of a jump. In a compaction front the linear field is the jump, and
    hardly anything would be left to damp it. A front: compression of h |div v| / c above ``front`` (all of it from three times
    that on), and close to uniaxial: -div v over the norm of the strain rate from 0.7 (equal to shear) to 1.
    """
    hoops = 1.0 if axisymmetric else 0.0
    vr, ring, sound, lxx, lzz, shear = s.u, s.ring, s.sound, s.lxx, s.lzz, s.shear
    for i in range(low, high):
        hoop = hoops * vr[i] / ring[i]
        a, b, c = lxx[i], lzz[i], shear[i]
        pressed = max(-(a + b + hoop), 0.0)
        size = math.sqrt(a * a + b * b + hoop * hoop + 0.5 * c * c)
        along = min(max((pressed / max(size, 1.0e-300) - 0.7) / 0.3, 0.0), 1.0)
        strong = min(max((h * pressed / sound[i] - front) / (2.0 * front), 0.0), 1.0)
        keep = 1.0 - along * strong
        lxx[i] = a * keep
        lzz[i] = b * keep
        shear[i] = c * keep


@compiled
def bound_step(low, high, axisymmetric, h, s, worst):
    """The larger of ``worst`` and of c² (1 + (a h/r)²) max(1, tr B / (2 FEW))², m²/s², over particles low..high-1.

    Near the axis the hoop strain v/r is stiffer than any gradient, and so is the gradient of a particle with few neighbours: both
    ask for a shorter step.
    """
    reach = HOOP_STIFFNESS * h if axisymmetric else 0.0
    ring, sound, bxx, bzz = s.ring, s.sound, s.gxx, s.gzz
    for i in range(low, high):
        ratio = reach / ring[i]
        few = max((bxx[i] + bzz[i]) * (0.5 / FEW), 1.0)
        worst = max(worst, (sound[i] * few) ** 2 * (1.0 + ratio * ratio))
    return worst


@compiled
def deform(low, high, dt, s):
    """Deformation gradient in the plane, dD/dt = L D: tells how thin the dust beside the projectile has become."""
    lxx, lxz, lzx, lzz, dxx, dxz, dzx, dzz = s.lxx, s.lxz, s.lzx, s.lzz, s.dxx, s.dxz, s.dzx, s.dzz
    for i in range(low, high):
        a, b, c, d = dxx[i], dxz[i], dzx[i], dzz[i]
        dxx[i] = a + dt * (lxx[i] * a + lxz[i] * c)
        dxz[i] = b + dt * (lxx[i] * b + lxz[i] * d)
        dzx[i] = c + dt * (lzx[i] * a + lzz[i] * c)
        dzz[i] = d + dt * (lzx[i] * b + lzz[i] * d)


@compiled
def find_compaction(low, high, axisymmetric, scale, reference, s):
    """Density that each particle would have, had it begun at φ = ``reference``; and with what diffusivity, m²/s, neighbours
    exchange it: ``scale`` (m²) times the rate at which dust is crushed. Nothing creeps at rest or in elastic dust, a crust
    stays a crust. Where dust is pressed along one line there is none: a plane front needs no help.
    """
    hoops = 1.0 if axisymmetric else 0.0
    vr, ring, lxx, lxz, lzx, lzz, crushing = s.u, s.ring, s.lxx, s.lxz, s.lzx, s.lzz, s.crushing
    density, initial, compaction, diffusivity = s.density, s.initial, s.compaction, s.diffusivity
    for i in range(low, high):
        hoop = hoops * vr[i] / ring[i]
        a, b, c = lxx[i], lzz[i], lxz[i] + lzx[i]
        size = math.sqrt(a * a + b * b + hoop * hoop + 0.5 * c * c)
        along = min(max((-(a + b + hoop) / max(size, 1.0e-300) - 0.6) / 0.3, 0.0), 1.0)
        compaction[i] = density[i] * (reference / initial[i])
        diffusivity[i] = scale * crushing[i] * (1.0 - along)
