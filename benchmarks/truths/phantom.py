"""Scans whose truth is known: a bead in dust with a compacted zone, blur, noise, rings, cupping, any bit depth."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tifffile
from scipy.ndimage import gaussian_filter

from labsim.records import FloatArray, GreyCalibration, Measured, Projectile, Scan


@dataclass(frozen=True)
class Phantom:
    """What a phantom is made of. Lengths in voxels where not said otherwise; ``centre`` is the bead's (x, y, k).

    zone : filling factor added at the bead's lowest point; it falls off as a Gaussian of width zone_width bead radii.
    noise, ring, cup : in filling factor (one voxel; one ring's standard deviation, one radius in
    seven has one; rim minus middle). tilt : rad about
    which the zone leans towards x. surface : slice number of the free surface. gradient : filling factor per m of depth.
    """

    shape: tuple[int, int, int] = (110, 104, 104)  # slices, rows, columns
    centre: tuple[float, float, float] = (54.3, 50.6, 34.4)
    radius: float = 13.5
    voxel: float = 37e-6  # m
    filling_factor: float = 0.15
    gradient: float = 0.0
    zone: float = 0.10
    zone_width: float = 1.2
    surface: float = 22.0
    blur: float = 0.7
    noise: float = 0.03
    ring: float = 0.0
    cup: float = 0.0
    tilt: float = 0.0
    bits: int = 16
    saturated: bool = False
    seed: int = 0

    def truth(self, r: FloatArray, z: FloatArray) -> FloatArray:
        """Filling factor of the dust, (nz, nr), at r, z (m, 0 at the surface); the bead is left out."""
        depth = (self.centre[2] + self.radius - self.surface) * self.voxel
        distance2 = r[None, :] ** 2 + (z[:, None] + depth) ** 2
        width = self.zone_width * self.radius * self.voxel
        sound = self.filling_factor - self.gradient * z[:, None]
        return np.where(z[:, None] < 0, sound + self.zone * np.exp(-distance2 / width**2), 0.0)

    def volume_beyond(self, threshold: float) -> float:
        """m^3 of dust denser than a threshold, outside the bead, by fine integration."""
        step = self.radius * self.voxel / 60
        r = (np.arange(240) + 0.5) * step
        bottom = (self.centre[2] + self.radius - self.surface) * self.voxel
        z = -(np.arange(int((bottom + 3 * self.radius * self.voxel) / step)) + 0.5) * step
        centre = -bottom + self.radius * self.voxel
        dense = self.truth(r, z) > threshold
        dense &= np.hypot(r[None, :], z[:, None] - centre) > self.radius * self.voxel
        return float((dense * 2 * np.pi * r[None, :] * step * step).sum())

    @property
    def calibration(self) -> GreyCalibration:
        """Air well above grey 0; the bead below the top of the range unless ``saturated``."""
        top = 2**self.bits - 1
        return GreyCalibration(0.12 * top, top * (1.2e-3 if self.saturated else 2.9e-4), 2000.0)

    def grey(self) -> np.ndarray:
        """The slices, (slices, rows, columns), of uint8 or uint16."""
        rng = np.random.default_rng(self.seed)
        k, y, x = (n.astype(np.float32) for n in np.mgrid[: self.shape[0], : self.shape[1], : self.shape[2]])
        lean = np.tan(self.tilt) * np.maximum(k - self.centre[2], 0)
        r2 = (x - self.centre[0] - lean) ** 2 + (y - self.centre[1]) ** 2
        width = self.zone_width * self.radius
        below = np.clip(k - self.surface + 0.5, 0, 1)
        tip = self.centre[2] + self.radius
        sound = self.filling_factor + self.gradient * self.voxel * np.maximum(k - self.surface, 0)
        dust = below * (sound + self.zone * np.exp(-(r2 + (k - tip) ** 2) / width**2))
        d = np.sqrt((x - self.centre[0]) ** 2 + (y - self.centre[1]) ** 2 + (k - self.centre[2]) ** 2)
        inside = np.clip(self.radius - d + 0.5, 0, 1)
        bead = 2540.0 / self.calibration.density_solid
        phi = (
            gaussian_filter(dust * (1 - inside) + bead * inside, self.blur)
            if self.blur
            else dust * (1 - inside) + bead * inside
        )
        rho = np.hypot(x[0] - (self.shape[2] - 1) / 2, y[0] - (self.shape[1] - 1) / 2)
        if self.ring:
            number = int(rho.max()) + 2
            rings = rng.normal(0, self.ring, number) * (rng.random(number) < 0.15)
            phi = phi + np.where(phi > 0.05, rings[np.rint(rho).astype(int)][None], 0)
        if self.cup:
            phi = phi * (1 + self.cup / self.filling_factor * ((rho / (self.shape[1] / 2)) ** 2 - 0.5)[None])
        phi = phi + rng.normal(0, self.noise, phi.shape) if self.noise else phi
        c = self.calibration
        grey = c.grey_air + c.grey_per_density * c.density_solid * phi
        return np.clip(np.rint(grey), 0, 2**self.bits - 1).astype(np.uint8 if self.bits <= 8 else np.uint16)

    def write(self, folder: Path, *, grey: np.ndarray | None = None) -> Scan:
        """Write the slices as TIFF into a folder and return the scan record that belongs to them."""
        folder.mkdir(parents=True, exist_ok=True)
        for k, image in enumerate(self.grey() if grey is None else grey):
            tifffile.imwrite(folder / f"slice_{k:04d}.tif", image)
        return self.scan(folder)

    def scan(self, slices: Path) -> Scan:
        radius = self.radius * self.voxel
        projectile = Projectile("sphere", radius, 2540.0 * 4 / 3 * np.pi * radius**3)
        return Scan(
            "phantom", projectile, Measured(0.8, 0.04), slices, self.voxel, "top", self.bits, self.calibration
        )
