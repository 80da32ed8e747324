"""What two estimates of one motion say together: both ends of the rod, registration and edge, scatter and error bar."""

from __future__ import annotations

import numpy as np

from ...records import FloatArray
from ..frames import Frames
from ..picture.scene import Scene
from ..projectile.ends import fit_edge
from ..projectile.following import EndTrack, Progress
from ..projectile.sharpness import describe_sharpness

LEAST_CHANGE = 0.03  # px of the rod's length
STEADY = 8.0  # standard errors of a slope


def clip_gap(gap: FloatArray, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Leave out distances between the ends that lie far from the others."""
    spread = max(1.4826 * float(np.median(np.abs(gap - np.median(gap)))), 0.005)
    keep = np.abs(gap - np.median(gap)) < 4 * spread
    return gap[keep], variance[keep]


def join_ends(
    top: EndTrack,
    tip_y: FloatArray,
    tip_x: FloatArray,
    tip_sigma: FloatArray,
    tip_reason: list[str],
    reach: float,
    side: float,
    doubt: float,
    shared: bool,
) -> tuple[FloatArray, FloatArray, FloatArray, list[str]]:
    """One track from both ends: weighted mean where both are seen, the one that is seen elsewhere."""
    from_top = top.y + reach
    top_sigma = np.hypot(top.sigma, doubt)
    w_tip = np.where(np.isfinite(tip_y), 1 / tip_sigma**2, 0.0)
    w_top = np.where(np.isfinite(from_top), 1 / top_sigma**2, 0.0)
    if shared:  # both see the same pixels: the better one alone, a mean would count their noise twice
        w_tip, w_top = np.where(w_tip >= w_top, w_tip, 0.0), np.where(w_top > w_tip, w_top, 0.0)
    total = w_tip + w_top
    with np.errstate(invalid="ignore", divide="ignore"):
        row = (np.where(w_tip > 0, tip_y, 0.0) * w_tip + np.where(w_top > 0, from_top, 0.0) * w_top) / total
        sigma = 1 / np.sqrt(total)
    x = np.where(np.isfinite(tip_x), tip_x, top.x + side)
    reason = []
    for i in range(len(row)):
        if total[i] > 0:
            reason.append("")
        elif top.reason[i] == tip_reason[i] or not tip_reason[i]:
            reason.append(top.reason[i])
        else:
            reason.append(f"{top.reason[i]}, {tip_reason[i]}" if top.reason[i] else tip_reason[i])
    return row, np.where(total > 0, sigma, np.nan), x, reason


def compare_with_edge(
    frames: Frames,
    scene: Scene,
    usable: np.ndarray,
    top: EndTrack,
    edge: tuple[float, float, float, float, float],
    row: FloatArray,
    sigma: FloatArray,
    reason: list[str],
    warnings: list[str],
    progress: Progress | None,
) -> float | None:
    """Second estimate by the erf edge; frames that disagree by far are rejected. Returns the rms difference."""
    count = len(row)
    difference, error, blur = (np.full(count, np.nan) for _ in range(3))
    for i, picture in enumerate(frames):
        if np.isfinite(top.y[i]):
            second = fit_edge(
                picture,
                scene.background,
                usable,
                edge,
                scene.edge_noise,
                float(top.y[i]),
                float(top.x[i]),
                scene.projectile_level * float(scene.brightness[i]),
                float(scene.brightness[i]),
                scene.find_limit(i),
            )
            if second is not None:
                difference[i], error[i] = second[0] - top.y[i], np.hypot(second[1], top.sigma[i])
                blur[i] = second[2]
    known = np.isfinite(difference)
    if known.sum() < 4:
        return None
    sharpness = None if frames.lossy else describe_sharpness(blur, top.y)
    warnings += [] if sharpness is None else [sharpness]
    difference -= np.nanmedian(difference)
    spread = max(1.4826 * float(np.nanmedian(np.abs(difference))), float(np.nanmedian(error)))
    wrong = known & (np.abs(difference) > np.maximum(0.08, 6 * spread))
    for i in map(int, np.flatnonzero(wrong)):
        reason[i] = "registration and edge disagree"
    rms = float(np.sqrt(np.mean(difference[known & ~wrong] ** 2)))
    if spread > 3 * float(np.nanmedian(error)) and spread > 0.02:
        warnings.append(
            f"registration and erf edge differ by {spread:.3f} px, more than their error bars allow"
        )
    return rms


def compare_lengths(gap: FloatArray, variance: FloatArray) -> float:
    """How much more the distance between the ends of a rigid rod scatters than the error bars of both say; at least 1.

    Unlike the scatter about the neighbours it also sees errors that last for many frames.
    """
    if len(gap) < 12:
        return 1.0
    return max(1.0, float(np.std(gap, ddof=1) / np.sqrt(np.mean(variance))))


def describe_length(row: FloatArray, gap: FloatArray, variance: FloatArray) -> str | None:
    """A warning where the distance between the ends of a rigid rod is not one number, else None.

    row, gap : (n,) of the tip and of the distance; variance : of the distances that were kept.
    """
    spread = max(1.4826 * float(np.median(np.abs(gap - np.median(gap)))), 0.005)
    keep = np.abs(gap - np.median(gap)) < 4 * spread
    if keep.sum() < 8:
        return None
    row, gap = row[keep] - np.mean(row[keep]), gap[keep]
    noise = float(np.sqrt(np.median(variance)))
    scatter = float(np.std(gap))
    slope = float(np.sum(row * gap) / np.sum(row**2))
    left = float(np.std(gap - slope * row))
    change, path = slope * float(np.ptp(row)), float(np.ptp(row))
    if abs(change) > LEAST_CHANGE and abs(slope) > STEADY * left / np.sqrt(np.sum(row**2)):
        return (
            f"the rod gets {abs(change):.2f} px {'longer' if change > 0 else 'shorter'} while it falls through {path:.0f} px: "
            "lens distortion, a fall out of the plane, focus, or a shutter that reads row after row; rows err with it"
        )
    if scatter > max(LEAST_CHANGE, 3 * noise):
        return (
            f"length of the rod scatters by {scatter:.3f} px: does it turn or leave the plane, or pass dirt?"
        )
    return None


def raise_to_scatter(
    row: FloatArray, sigma: FloatArray, what: str, warnings: list[str], tails: float = 4.0
) -> FloatArray:
    """Raise the error bars of one end where it scatters about its neighbours by more than the error bars say.

    Beyond ``tails`` robust standard deviations a frame is an accident and does not count.
    """
    index = np.flatnonzero(np.isfinite(row))
    if len(index) < 20:
        return sigma
    near = np.stack([index[k : len(index) - 3 + k] for k in range(4)])
    near = near[:, near[3] - near[0] == 3]
    # third difference of four neighbours: blind to position, speed and acceleration
    weights = np.array([1.0, -3.0, 3.0, -1.0])
    ratios = (weights @ row[near]) / np.sqrt(weights**2 @ sigma[near] ** 2)
    if ratios.size < 12:
        return sigma
    inside = np.abs(ratios) < tails * 1.4826 * np.median(np.abs(ratios))
    factor = float(np.sqrt(np.mean(ratios[inside] ** 2)))
    if factor > 1.0 + 1.5 / np.sqrt(ratios.size):  # beyond what chance does with so few
        if factor > 1.6:
            warnings.append(
                f"{what} scatters {factor:.1f} times more than the noise explains: its error bars were raised"
            )
        return sigma * factor
    return sigma
