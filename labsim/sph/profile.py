"""The outline of a projectile: a chain of arcs and straight lines in (r, z), from the lowest point on the axis to the rod.

The chain is written as a walk along the surface. Its heading is the angle of the outward normal, 0 downwards, a quarter turn
outwards; an arc turns it, so that lines and arcs meet without a kink. An arc of radius 0 is a sharp edge; one that turns back is
hollow. The walk ends on a shaft (heading a quarter turn, for ever upwards) or on the axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import SimulationError
from ..records import FloatArray
from ._jit import compiled, compiled_entry

SIDE = math.pi / 2  # heading of a shaft
# columns: centre of an arc or begin of a line; radius; first and last normal, anticlockwise; length of a line; 1 for an arc,
# -1 for a hollow one, 0 for a line
R, Z, RADIUS, FIRST_R, FIRST_Z, LAST_R, LAST_Z, LENGTH, BENT = range(9)


@dataclass(frozen=True)
class Arc:
    """Turn to the heading ``to`` (rad) on a circle of ``radius`` (m); hollow where ``to`` is less than the heading."""

    radius: float
    to: float


@dataclass(frozen=True)
class Line:
    """Straight on for ``length`` (m); inf: the shaft."""

    length: float


Piece = Arc | Line


def shaft(radius: float, rod: float = 0.0) -> tuple[Piece, ...]:
    """The end of a chain whose heading is a quarter turn at ``radius``: a rod as wide, or a thinner one behind a shoulder."""
    if not 0.0 < rod < radius:
        return (Line(math.inf),)
    return Arc(0.0, math.pi), Line(radius - rod), Arc(0.0, SIDE), Line(math.inf)


def walk(pieces: tuple[Piece, ...]) -> FloatArray:
    """Rows of the chain, (m, 9), heights from the lowest point on. Raises SimulationError where it is no outline."""
    r = z = heading = 0.0
    rows = []
    for piece in pieces:
        first = _normal(heading)
        if isinstance(piece, Line):
            if not piece.length >= 0.0 or (math.isinf(piece.length) and heading != SIDE):
                _refuse(f"a line of {piece.length!r} m at {math.degrees(heading):.4g}° cannot be walked")
            rows.append((r, z, 0.0, *first, *first, piece.length, 0.0))
            r, z = r - first[1] * piece.length if first[1] else r, z + first[0] * piece.length
        else:
            if not (piece.radius >= 0.0 and 0.0 <= piece.to <= math.pi):
                _refuse(f"an arc of {piece.radius!r} m to {math.degrees(piece.to):.4g}° cannot be walked")
            last, bent = _normal(piece.to), 1.0 if piece.to >= heading else -1.0
            centre = r - bent * piece.radius * first[0], z - bent * piece.radius * first[1]
            turn = (*first, *last) if bent > 0.0 else (*last, *first)
            rows.append((*centre, piece.radius, *turn, 0.0, bent))
            r, z = centre[0] + bent * piece.radius * last[0], centre[1] + bent * piece.radius * last[1]
            heading = piece.to
        if r < -1e-9 * max(abs(z), 1e-6):
            _refuse(f"the outline crosses the axis at {r:.3g} m")
    if not (math.isinf(z) or abs(r) <= 1e-9 * abs(z)):
        _refuse(
            f"the outline ends in the open, at r {r:.3g} m, z {z:.3g} m; end it on a shaft or on the axis"
        )
    return np.array(rows)


def _normal(heading: float) -> tuple[float, float]:
    """Exact for whole quarter turns."""
    r, z = math.sin(heading), -math.cos(heading)
    return (0.0 if abs(r) < 1e-15 else r), (0.0 if abs(z) < 1e-15 else z)


def _refuse(what: str) -> None:
    raise SimulationError("simulation", "projectile.tip", f"{what}; see the recipe of a tip")


def has_shaft(profile: FloatArray) -> bool:
    return bool(np.isinf(profile[-1, LENGTH]))


def is_blunt(profile: FloatArray) -> bool:
    """Whether a face, not a point, meets the dust first."""
    first = profile[0]
    return bool(first[BENT] == 0.0 and first[FIRST_R] == 0.0 and first[LENGTH] > 0.0)


def outline(profile: FloatArray, height: float, points: int = 60) -> tuple[FloatArray, FloatArray]:
    """r and z (m) along the surface, cut at ``height`` above the lowest point; ``points`` on each arc."""
    r, z = [0.0], [0.0]
    for row in profile:
        if np.isinf(row[LENGTH]):
            r += [row[R], row[R]]
            z += [row[Z], max(height, row[Z])]
        elif row[BENT] == 0.0:
            r += [row[R], row[R] - row[FIRST_Z] * row[LENGTH]]
            z += [row[Z], row[Z] + row[FIRST_R] * row[LENGTH]]
        else:
            turn = np.linspace(
                math.atan2(row[FIRST_R], -row[FIRST_Z]), math.atan2(row[LAST_R], -row[LAST_Z]), points
            )[:: int(row[BENT])]
            r.extend(row[R] + row[BENT] * row[RADIUS] * np.sin(turn))
            z.extend(row[Z] - row[BENT] * row[RADIUS] * np.cos(turn))
    across, up = np.array(r), np.array(z)
    above = np.nonzero(up > height)[0]
    if above.size:
        k = above[0]
        part = (height - up[k - 1]) / (up[k] - up[k - 1])
        across = np.append(across[:k], across[k - 1] + part * (across[k] - across[k - 1]))
        up = np.append(up[:k], height)
    return across, up


def volume_below(profile: FloatArray, height: float, planar: bool = False) -> float:
    """What lies below ``height`` above the lowest point, m³ (planar: m²)."""
    r, z = outline(profile, height, 2000)
    step = np.diff(z)
    if planar:
        return float(np.sum((r[1:] + r[:-1]) * step))
    return float(math.pi / 3 * np.sum((r[1:] ** 2 + r[1:] * r[:-1] + r[:-1] ** 2) * step))


@compiled
def find_surface(x, z, tip, profile):
    """Signed distance (m) of a point to the surface of a projectile whose lowest point is at height ``tip``, and the normal
    there. Each piece answers for the points whose shortest way leads to it; the nearest answer counts."""
    best, normal_x, normal_z = 1.0e9, 0.0, 0.0
    across = abs(x)
    for k in range(profile.shape[0]):
        a = across - profile[k, 0]
        b = z - (tip + profile[k, 1])
        if profile[k, 8] == 0.0:
            along = b * profile[k, 3] - a * profile[k, 4]
            d = a * profile[k, 3] + b * profile[k, 4]
            if along >= 0.0 and along <= profile[k, 7] and abs(d) < abs(best):
                best, normal_x, normal_z = d, profile[k, 3], profile[k, 4]
        elif profile[k, 8] > 0.0:
            if profile[k, 3] * b >= profile[k, 4] * a and a * profile[k, 6] >= b * profile[k, 5]:
                length = math.sqrt(a * a + b * b)
                d = length - profile[k, 2]
                if length > 0.0 and abs(d) < abs(best):
                    best, normal_x, normal_z = d, a / length, b / length
        elif profile[k, 3] * b <= profile[k, 4] * a and a * profile[k, 6] <= b * profile[k, 5]:
            length = math.sqrt(a * a + b * b)
            d = profile[k, 2] - length
            if length > 0.0 and abs(d) < abs(best):
                best, normal_x, normal_z = d, -a / length, -b / length
    return best, (normal_x if x > 0.0 else -normal_x), normal_z


@compiled_entry
def measure_distance(x, z, tip, profile):
    """``find_surface`` of many points: their distances, m."""
    distance = np.empty(x.size)
    for i in range(x.size):
        distance[i] = find_surface(x[i], z[i], tip, profile)[0]
    return distance
