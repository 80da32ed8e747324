"""Whether the slices of a stack follow each other: none lost, doubled, out of order, or from another scan.

Four witnesses, each held against the scatter that the stack itself gives: no two slices of a real scan hold the same numbers;
the level of the dust far from the bead changes smoothly; the bead's outline is a sphere's, slice by slice; the dust below the
bead's middle, in blocks of a quarter of its radius, has no step from one slice to the next, nor the step that slices which
are not there would make of its slope.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import least_squares

from ...errors import MeasurementError
from ...records import FloatArray
from .stack import SliceStack

if TYPE_CHECKING:  # they look here for jumps while they are being made
    from ..bead import Bead
    from ..surface import Surface

ODD = 8.0  # standard deviations, of numbers whose scatter the stack itself gives
LEVEL_LEAST = 0.02  # of the step from air to dust
OUTLINE_LEAST = (
    4.0  # square voxels of r^2 between neighbours; half a slice lost 4 voxels from the middle makes as much
)
CENTRE_LEAST = 0.4  # voxels
CAP_LEAST = 3.0  # bead radii, of r^2 at its poles: a sound end makes 2.2 to 2.5, each lost slice 2 more
CAP = 0.85  # radii from the bead's middle within which outlines are looked at
REGIONS = (3.0, 1.5)  # bead radii from the axis in which steps are looked for
NOISE_LEAST = (
    0.005  # of the step from air to dust: slices without noise still have a compacted zone that bends
)
STEP_LEAST = 0.5  # chi2 per block above the usual; 24 labelled scans reach 0.20 and 0.61 in the two regions, of 0.5 and 1.0
DUST = "the dust about the bead"
DUST_STEPS = DUST + " jumps"  # how its own warnings begin
WINDOW = 4  # slices on each side of a step
MARGIN = 4.0  # voxels about the bead, and beyond the surface's width, that are left out


def find_doubled(stack: SliceStack) -> None:
    """Raises MeasurementError where two slices hold the same numbers though they hold noise."""
    seen: dict[bytes, int] = {}
    for k, image in enumerate(stack):
        digest = hashlib.blake2b(np.ascontiguousarray(image).tobytes(), digest_size=16).digest()
        if digest in seen and _has_noise(image):
            raise MeasurementError(
                stack.source, "scan.slices",
                f"{stack.name(seen[digest])} and {stack.name(k)} hold the same picture; export the slices again, each once",
            )  # fmt: skip
        seen.setdefault(digest, k)


def _has_noise(image: np.ndarray) -> bool:
    """Whether most voxels differ from the line through their neighbours by more than rounding does."""
    values = image.astype(np.float64)
    bend = np.abs(values[:, 2:] - 2 * values[:, 1:-1] + values[:, :-2])
    return bool(np.median(bend) > (2.0 if image.dtype.kind in "ui" else 0.0))


def find_bright_jumps(area: FloatArray) -> list[int]:
    """Slices k after which the bright area (pixels, of each slice) changes faster than a sphere's can, 2 pi R a slice."""
    radius = np.sqrt(max(float(area.max()), 1.0) / np.pi)
    return np.flatnonzero(np.abs(np.diff(area)) > 1.5 * 2 * np.pi * radius).tolist()


def check_neighbours(stack: SliceStack, bead: Bead, surface: Surface, top: float) -> list[str]:
    """Warnings that name the slices between which something is wrong. top : highest grey level of the range."""
    size = max(2, round(bead.stated_radius / 4))
    ny, nx = (n // size for n in stack.shape)
    blocks = np.empty((stack.count, ny, nx), np.float32)
    for k, image in enumerate(stack):
        cut = image[: ny * size, : nx * size].reshape(ny, size, nx, size)
        blocks[k] = cut.mean((1, 3), dtype=np.float32)
    x0, y0, _ = bead.centre
    x = (np.arange(nx) + 0.5) * size - 0.5 - x0
    y = (np.arange(ny) + 0.5) * size - 0.5 - y0
    distance = np.hypot(x[None, :], y[:, None])
    found: dict[tuple[int, int], list[str]] = {}
    for what, pairs in (
        ("the dust's level far from the bead", _find_levels(blocks, distance, bead, surface, size)),
        ("the bead's outline", _find_outlines(stack, bead, surface, top)),
        (DUST, _find_steps(blocks, distance, bead, surface, size)),
    ):
        for pair in pairs:
            if what not in found.setdefault(pair, []):
                found[pair].append(what)
    return [
        f"{' and '.join(words)} {'jump' if len(words) > 1 else 'jumps'} between {stack.name(a)} and {stack.name(b)}: "
        "slices are lost, doubled, out of order or of another scan"
        for (a, b), words in _merge(found).items()
    ]


def _merge(found: dict[tuple[int, int], list[str]]) -> dict[tuple[int, int], list[str]]:
    """Places that touch are one."""
    merged: list[tuple[int, int, list[str]]] = []
    for (a, b), words in sorted(found.items()):
        if merged and a <= merged[-1][1] + 1:
            first, last, known = merged[-1]
            merged[-1] = (first, max(last, b), known + [w for w in words if w not in known])
        else:
            merged.append((a, b, list(words)))
    return {(a, b): words for a, b, words in merged}


def _spread(values: FloatArray) -> float:
    """Standard deviation by the median of absolute deviations."""
    return 1.48 * float(np.median(np.abs(values - np.median(values)))) if len(values) else 0.0


def _find_levels(
    blocks: FloatArray, distance: FloatArray, bead: Bead, surface: Surface, size: int
) -> list[tuple[int, int]]:
    """Single slices whose dust or air far from the bead is brighter or darker than their neighbours'."""
    far = distance > min(3.3 * bead.stated_radius, 0.85 * distance.max())
    level = blocks[:, far].mean(1)
    off = level - median_filter(level, 5, mode="nearest")
    lean = surface.tilt * distance.max() if surface.leans else 0.0
    rows = np.arange(len(level))
    use = np.abs(rows - surface.row) > MARGIN + 3 * surface.width + lean
    odd = []
    voxels = far.sum() * size**2
    for part, scatter in (
        (use & (rows < surface.row), surface.air_scatter),
        (use & (rows > surface.row), surface.dust_scatter),
    ):
        noise = max(
            _spread(off[part]), scatter / np.sqrt(voxels)
        )  # of a few rows the spread is itself uncertain
        limit = max(ODD * noise, LEVEL_LEAST * (surface.dust - surface.air))
        odd += [
            (max(k - 1, 0), min(k + 1, len(rows) - 1))
            for k in map(int, np.flatnonzero(part & (np.abs(off) > limit)))
        ]
    return odd


def _find_outlines(stack: SliceStack, bead: Bead, surface: Surface, top: float) -> list[tuple[int, int]]:
    """Pairs of slices between which the bead's outline changes otherwise than a sphere's, or its middle moves."""
    x0, y0, k0 = bead.centre
    first, last = (round(k0 + s * bead.radius) + s * 3 for s in (-1, 1))
    first, last = max(first, 0), min(last, stack.count - 1)
    if last - first < 8:
        return []
    half = int(np.ceil(bead.radius + 6))
    low_x, low_y = max(0, round(x0) - half), max(0, round(y0) - half)
    dust = max(surface.dust, surface.air)
    inner = stack.slice(round(k0))[round(y0) - 1 : round(y0) + 2, round(x0) - 1 : round(x0) + 2]
    threshold = 0.5 * (min(float(np.median(inner)), 0.98 * top) + dust)
    numbers = range(first, last + 1)
    rows = np.array(numbers)
    square, middle = np.empty(len(rows)), np.empty((len(rows), 2))
    for i, k in enumerate(numbers):
        window = stack.slice(k)[low_y : round(y0) + half + 1, low_x : round(x0) + half + 1]
        above = window > threshold
        square[i] = above.sum() / np.pi
        y, x = np.nonzero(above)
        middle[i] = (x.mean(), y.mean()) if len(x) else (np.nan, np.nan)
    fit = least_squares(
        lambda q: q[0] - q[1] * (rows - q[2]) ** 2 - square,
        [bead.radius**2, 1.0, k0],
        loss="soft_l1",
        f_scale=2.0,
    )
    step = np.diff(fit.fun)
    moved = np.diff(middle, axis=0)
    inner = np.abs(rows[:-1] + 0.5 - k0) < CAP * bead.radius
    odd = np.abs(step) > np.where(
        inner, max(ODD * _spread(step[inner]), OUTLINE_LEAST), CAP_LEAST * bead.radius
    )
    for axis in (0, 1):
        limit = max(ODD * _spread(moved[inner & np.isfinite(moved[:, axis]), axis]), CENTRE_LEAST)
        odd |= inner & ~(np.abs(moved[:, axis]) < limit)
    return [(int(rows[i]), int(rows[i + 1])) for i in np.flatnonzero(odd)]


def _find_steps(
    blocks: FloatArray, distance: FloatArray, bead: Bead, surface: Surface, size: int
) -> list[tuple[int, int]]:
    """Pairs of slices between which the dust about the bead changes by a step; lines on both sides meet otherwise."""
    start = int(np.ceil(max(bead.centre[2], surface.row + MARGIN + 3 * surface.width)))
    count = len(blocks)
    about = distance < 3 * bead.stated_radius
    n = np.arange(WINDOW)
    # the value at the meeting point of a line through WINDOW slices, half a slice beyond the last
    ahead = 1 / WINDOW + (n - n.mean()) * (WINDOW - 0.5 - n.mean()) / ((n - n.mean()) ** 2).sum()
    places = np.arange(start + WINDOW - 1, count - WINDOW)
    if len(places) < 3 * WINDOW:
        return []
    noise = max(_block_noise(blocks[start:], about), NOISE_LEAST * (surface.dust - surface.air))
    noise *= np.sqrt(2 * (ahead**2).sum())
    regions = [about & (distance < reach * bead.stated_radius) for reach in REGIONS]
    chi2 = np.ones((len(regions), len(places)))
    number = np.zeros(chi2.shape)
    for i, k in enumerate(places):
        before, after = blocks[k - WINDOW + 1 : k + 1], blocks[k + 1 : k + 1 + WINDOW]
        nearest = np.clip(bead.centre[2], k - WINDOW + 1, k + WINDOW)
        hidden = np.sqrt(max((bead.radius + MARGIN + 0.7 * size) ** 2 - (nearest - bead.centre[2]) ** 2, 0.0))
        pull = ((np.tensordot(ahead[::-1], after, 1) - np.tensordot(ahead, before, 1)) / noise) ** 2
        for j, region in enumerate(regions):
            use = region & (distance > hidden)
            number[j, i] = use.sum()
            if number[j, i] > 8:
                chi2[j, i] = pull[use].mean()
    found = []
    for values, blocks_used in zip(chi2, number, strict=True):
        beyond = values - np.median(values)
        # a mean over few blocks, where the bead hides the others, scatters more
        alike = beyond * np.sqrt(blocks_used / max(blocks_used.max(), 1))
        odd = (alike > ODD * _spread(alike)) & (beyond > STEP_LEAST)
        for i in map(
            int, np.flatnonzero(odd)
        ):  # a step shows in the windows around it: its largest is where it is
            if values[i] == values[max(0, i - WINDOW) : i + WINDOW + 1].max():
                found.append((int(places[i]), int(places[i]) + 1))
    return found


def _block_noise(blocks: FloatArray, about: np.ndarray) -> float:
    return _spread(np.diff(blocks[:, about], axis=0).ravel()) / np.sqrt(2)
