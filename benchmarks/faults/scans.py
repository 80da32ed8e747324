"""CT scans with something wrong with them, whose truth is known: how far the map is off, and what labsim says of it.

    python -m benchmarks.faults.scans                 # all cases: phantoms, then damaged stacks
    python -m benchmarks.faults.scans "dark halo" swapped   # those whose name holds one of the words

Phantoms: 110 x 104 x 104 voxels of 37 um, filling factor 0.15, a compacted zone of +0.10 below the bead, noise 0.03 a voxel,
16 bits. chi2 is the mean of ((map - truth) / sigma)^2 over the cells of the zone (true excess above 0.02) outside the guard;
an honest error bar gives 1. "before" are the figures of labsim before scans were held against themselves.
Damaged stacks: the shipped scan p01-C01, its slices lost, doubled, swapped or taken from p05-C02. The last column is what labsim
says beyond what it says of the sound scan: an error or the warnings. "silent" is a failure where the map is not right.
"""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import tifffile
from scipy import ndimage

from benchmarks.truths.phantom import Phantom
from labsim.campaign import read_scan
from labsim.ct import compress, reduce_scan
from labsim.errors import LabsimError
from labsim.records import Scan

ZONE = 0.02  # true excess of the filling factor from which a cell belongs to the zone
NOISE = 0.03
SCANS = Path(__file__).parents[2] / "data" / "ct" / "labelled_scans"

Volume = np.ndarray
Distort = Callable[[Volume, Phantom, np.random.Generator], Volume]


@dataclass(frozen=True)
class Case:
    """distort : of the noiseless filling factor (slices, rows, columns). chi2, tip_mm : before; None where it was refused."""

    name: str
    chi2: float | None
    tip_mm: float | None
    said: bool
    phantom: dict = field(default_factory=dict)
    distort: Distort | None = None
    noise: float = NOISE


def render(case: Case, seed: int = 0) -> tuple[Phantom, np.ndarray]:
    """The phantom and its grey levels with the case's fault in them."""
    phantom = Phantom(**{"noise": 0.0, "seed": seed, **case.phantom})
    fine = replace(phantom, bits=16, saturated=False)
    solid = fine.calibration.grey_per_density * fine.calibration.density_solid
    phi = (fine.grey() - fine.calibration.grey_air) / solid
    rng = np.random.default_rng(seed)
    if case.distort is not None:
        phi = case.distort(phi, phantom, rng)
    phi = phi + rng.normal(0, case.noise, phi.shape)
    c = phantom.calibration
    grey = c.grey_air + c.grey_per_density * c.density_solid * phi
    top = 2**phantom.bits - 1
    return phantom, np.clip(np.rint(grey), 0, top).astype(np.uint8 if phantom.bits == 8 else np.uint16)


def _grid(phi: Volume) -> list[np.ndarray]:
    return [n.astype(np.float32) for n in np.mgrid[: phi.shape[0], : phi.shape[1], : phi.shape[2]]]


def _distance(phi: Volume, phantom: Phantom) -> np.ndarray:
    k, y, x = _grid(phi)
    x0, y0, k0 = phantom.centre
    return np.sqrt((x - x0) ** 2 + (y - y0) ** 2 + (k - k0) ** 2)


def halo(share: float, length: float = 5.5) -> Distort:
    """Dust about the bead reads too dark, fading over some voxels (beam hardening, reconstruction)."""

    def distort(phi: Volume, phantom: Phantom, rng: np.random.Generator) -> Volume:
        beyond = _distance(phi, phantom) - phantom.radius
        return phi * np.where(beyond > 1.5, 1 - share * np.exp(-beyond / length), 1.0)

    return distort


def streak(share: float, width: float = 1.2) -> Distort:
    """A dark band through the bead, in the bead's slices."""

    def distort(phi: Volume, phantom: Phantom, rng: np.random.Generator) -> Volume:
        k, y, _ = _grid(phi)
        band = np.exp(-0.5 * ((y - phantom.centre[1]) / width) ** 2) * (
            np.abs(k - phantom.centre[2]) < phantom.radius + 8
        )
        return phi * np.where(_distance(phi, phantom) > phantom.radius + 1.5, 1 - share * band, 1.0)

    return distort


def wedge(degrees: float) -> Distort:
    """Projections over an angle are missing: a wedge of every slice's Fourier plane is empty."""

    def distort(phi: Volume, phantom: Phantom, rng: np.random.Generator) -> Volume:
        ky, kx = np.meshgrid(np.fft.fftfreq(phi.shape[1]), np.fft.fftfreq(phi.shape[2]), indexing="ij")
        empty = np.abs(np.arctan2(ky, np.abs(kx))) < np.deg2rad(degrees / 2)
        empty[0, 0] = False
        return np.stack([np.fft.ifft2(np.where(empty, 0, np.fft.fft2(image))).real for image in phi])

    return distort


def rings(size: float, *, own: bool = False) -> Distort:
    """Rings at every radius about the middle of the slices; own : each slice has others."""

    def distort(phi: Volume, phantom: Phantom, rng: np.random.Generator) -> Volume:
        _, y, x = _grid(phi[:1])
        rho = np.rint(np.hypot(x[0] - (phi.shape[2] - 1) / 2, y[0] - (phi.shape[1] - 1) / 2)).astype(int)
        drawn = rng.normal(0, size, (len(phi) if own else 1, rho.max() + 1))
        return phi + np.where(phi > 0.05, drawn[:, rho], 0.0)

    return distort


def cup(share: float) -> Distort:
    """Dust reads darker towards the middle of the slices, as beam hardening leaves it."""

    def distort(phi: Volume, phantom: Phantom, rng: np.random.Generator) -> Volume:
        _, y, x = _grid(phi[:1])
        rho = np.hypot(x - (phi.shape[2] - 1) / 2, y - (phi.shape[1] - 1) / 2) / (phi.shape[1] / 2)
        return phi * (1 + share * (rho**2 - 0.5))

    return distort


def spaced(factor: float) -> Distort:
    """Slices lie ``factor`` pixels apart."""

    def distort(phi: Volume, phantom: Phantom, rng: np.random.Generator) -> Volume:
        k = np.arange(phi.shape[0]) * factor
        last = phi.shape[0] - 1
        lower = np.clip(np.floor(k).astype(int), 0, last)
        upper, part = np.clip(lower + 1, 0, last), (k - np.floor(k))[:, None, None]
        return phi[lower] * (1 - part) + phi[upper] * part

    return distort


def lean(degrees: float) -> Distort:
    """The whole sample is turned about the bead, towards x."""

    def distort(phi: Volume, phantom: Phantom, rng: np.random.Generator) -> Volume:
        a = np.deg2rad(degrees)
        turn = np.array([[np.cos(a), 0, -np.sin(a)], [0, 1, 0], [np.sin(a), 0, np.cos(a)]])
        x0, y0, k0 = phantom.centre
        middle = np.array([k0, y0, x0])
        return ndimage.affine_transform(phi, turn, middle - turn @ middle, order=3, mode="nearest")

    return distort


PHANTOMS = [
    Case("clean", 1.0, -0.001, False),
    Case("clean 8 bit", 1.0, -0.001, False, {"bits": 8}),
    Case("saturated bead", None, None, True, {"saturated": True}),
    Case("noise 10 %", 0.9, -0.000, True, {}, None, 0.10),
    Case("rings, one in seven, 0.03", 1.2, -0.002, True, {"ring": 0.03}),
    Case("rings at every radius, 0.02", 2.6, -0.001, True, {}, rings(0.02)),
    Case("rings at every radius, each slice its own, 0.02", None, None, True, {}, rings(0.02, own=True)),
    Case("cupping -15 %", 4.3, -0.001, True, {}, cup(0.15)),
    Case("cupping -40 %", 20.6, -0.001, True, {}, cup(0.40)),
    Case("dark halo about the bead 20 %", 18.9, -0.000, False, {}, halo(0.20)),
    Case("dark streak through the bead 30 %", 3.6, -0.001, False, {}, streak(0.30)),
    Case("whole sample leans 2 degrees", 0.9, 0.004, True, {}, lean(2.0)),
    Case("whole sample leans 5 degrees", 5.4, 0.066, True, {}, lean(5.0)),
    Case("zone leans 5 degrees", 0.7, -0.001, True, {"tilt": float(np.deg2rad(5))}),
    Case("missing wedge 30 degrees", 32.9, -0.003, False, {}, wedge(30.0)),
    Case("slices 1.2 times the pixel apart", 82.4, -0.079, True, {}, spaced(1.2)),
]


def measure(scan: Scan, phantom: Phantom) -> str:
    """One line: zone chi2, mean error of the zone, chi2 of the whole map, tip error, what is said."""
    try:
        reduced = reduce_scan(scan)
    except LabsimError as trouble:
        return f"refused: {trouble.message}"
    m = reduced.map
    truth = phantom.truth(m.r, m.z)
    known = np.isfinite(m.filling_factor) & (m.count >= 50) & (m.z < -4 * phantom.voxel)[:, None]
    zone = known & (truth - phantom.filling_factor > ZONE)
    error = m.filling_factor - truth
    tip = m.tip_depth - (phantom.centre[2] + phantom.radius - phantom.surface) * phantom.voxel

    def chi2(cells: np.ndarray) -> float:
        return float(np.mean((error[cells] / m.sigma[cells]) ** 2))

    return (
        f"zone chi2 {chi2(zone):5.1f}  off {error[zone].mean():+.4f}  map chi2 {chi2(known):5.1f}  tip {tip * 1e3:+.3f} mm  "
        + ("; ".join(m.warnings) or "silent")
    )


def run_phantoms(words: list[str], seed: int = 0) -> None:
    for case in PHANTOMS:
        if words and not any(word in case.name for word in words):
            continue
        phantom, grey = render(case, seed)
        with tempfile.TemporaryDirectory() as folder:
            now = measure(phantom.write(Path(folder) / "slices", grey=grey), phantom)
        before = (
            ""
            if case.chi2 is None
            else f"zone chi2 {case.chi2:5.1f}  tip {case.tip_mm:+.3f} mm  {'said' if case.said else 'silent'}"
        )
        print(f"{case.name}\n  before  {before}\n  now     {now}", flush=True)


def _lose(files: list[bytes], other: list[bytes], first: int, number: int) -> list[bytes]:
    return files[:first] + files[first + number :]


def _double(files: list[bytes], other: list[bytes], first: int, number: int) -> list[bytes]:
    block = files[first : first + number]
    return files[: first + number] + block + files[first + number :]


def _swap(files: list[bytes], other: list[bytes], first: int, second: int, number: int = 1) -> list[bytes]:
    files = list(files)
    a, b = files[first : first + number], files[second : second + number]
    files[first : first + number], files[second : second + number] = b, a
    return files


def _replace(files: list[bytes], other: list[bytes], first: int, last: int) -> list[bytes]:
    return files[:first] + other[first:last] + files[last:]


def _cut(files: list[bytes], other: list[bytes], at: int, length: int) -> list[bytes]:
    return [data[:length] if k == at else data for k, data in enumerate(files)]


def _black(data: bytes) -> bytes:
    image = np.zeros_like(tifffile.imread(io.BytesIO(data)))
    stream = io.BytesIO()
    tifffile.imwrite(stream, image)
    return stream.getvalue()


DAMAGE: dict[str, Callable[[list[bytes], list[bytes]], list[bytes]]] = {
    "sound": lambda f, o: f,
    "two slices swapped, beside the bead (40, 44)": lambda f, o: _swap(f, o, 40, 44),
    "two slices swapped, below the bead (52, 60)": lambda f, o: _swap(f, o, 52, 60),
    "blocks of 20 swapped (30, 60)": lambda f, o: _swap(f, o, 30, 60, 20),
    "one slice lost (40)": lambda f, o: _lose(f, o, 40, 1),
    "one slice lost (34)": lambda f, o: _lose(f, o, 34, 1),
    "ten slices lost (35)": lambda f, o: _lose(f, o, 35, 10),
    "ten slices lost (44)": lambda f, o: _lose(f, o, 44, 10),
    "one slice doubled (40)": lambda f, o: _double(f, o, 40, 1),
    "ten slices doubled (40)": lambda f, o: _double(f, o, 40, 10),
    "one slice of another scan (40)": lambda f, o: _replace(f, o, 40, 41),
    "one slice of another scan (50)": lambda f, o: _replace(f, o, 50, 51),
    "lower half of another scan (54)": lambda f, o: _replace(f, o, 54, len(f)),
    "lower half of another scan (40)": lambda f, o: _replace(f, o, 40, len(f)),
    "a black slice (70)": lambda f, o: [*f[:70], _black(f[70]), *f[71:]],
    "an empty slice (60)": lambda f, o: _cut(f, o, 60, 0),
    "a truncated slice (60)": lambda f, o: _cut(f, o, 60, 2000),
}


def run_damage(words: list[str]) -> None:
    sound, other = (
        [file.read_bytes() for file in sorted((SCANS / name / "slices").iterdir())]
        for name in ("p01-C01", "p05-C02")
    )
    usual: tuple[str, ...] = ()
    for name, damage in DAMAGE.items():
        if words and name != "sound" and not any(word in name for word in words):
            continue
        with tempfile.TemporaryDirectory() as folder:
            scan = Path(folder) / "p01-C01"
            (scan / "slices").mkdir(parents=True)
            shutil.copy(SCANS / "p01-C01" / "scan.toml", scan)
            for k, data in enumerate(damage(sound, other)):
                (scan / "slices" / f"slice_{k:04d}.tif").write_bytes(data)
            try:
                m = reduce_scan(read_scan(scan)).map
            except LabsimError as trouble:
                print(f"{name}\n  refused: {trouble.message}", flush=True)
                continue
            curve = compress(m, thresholds=np.array([0.2]))
            usual = m.warnings if name == "sound" else usual
            said = "; ".join(text for text in m.warnings if text not in usual) or "silent"
            print(
                f"{name}\n  tip {m.tip_depth * 1e3:.3f} mm, denser than 0.20: "
                f"{curve.volume[0] / curve.sphere_volume:.3f} sphere volumes: {said}",
                flush=True,
            )


if __name__ == "__main__":
    run_phantoms(sys.argv[1:])
    run_damage(sys.argv[1:])
