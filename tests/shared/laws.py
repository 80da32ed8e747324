"""Campaigns whose drops obey a law in closed form, and a store whose runs obey it too: a real diagnosis in seconds.

The dust pushes back in proportion to the depth, k = π R p (1 + rate √(v/R)) of the tip's cross-section: x = D sin(t/T π/2).
Nothing of labsim is replaced but the solver.
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from campaign_files import CAMPAIGN, DROP, fill_in, write_scan_of

from benchmarks.truths.phantom import Phantom
from labsim.runs.store import RunStore
from labsim.sph import DropRun, DropSetting
from labsim.sph.run import Particles

PIXEL, RATE, SURFACE = 20e-6, 10000.0, 300.0
NOISE = 0.1  # px
DROPS = [
    (0.5, 1.33, 0.3),
    (0.5, 1.33, 0.5),
    (0.5, 1.33, 0.8),
    (0.5, 3.3, 0.4),
    (1.0, 12.0, 0.35),
    (1.0, 12.0, 0.7),
]


def move(radius: float, mass: float, speed: float, p_m: float, rate: float = 0.0) -> tuple[float, float]:
    """Depth (m) and stopping time (s)."""
    strength = p_m * (1 + rate * math.sqrt(speed / radius))
    turn = math.sqrt(math.pi * radius * strength / mass)
    return speed / turn, math.pi / 2 / turn


class LawStore(RunStore):
    """Answers every setting at once with the law; keeps no file."""

    def get_parts(self, settings, parts, **options):  # type: ignore[no-untyped-def]
        self.new += len(settings)
        return [run_law(setting) for setting in settings]


def run_law(setting: DropSetting) -> DropRun:
    material, projectile = setting.material, setting.projectile
    p_m = material.p_m * material.shear_factor**0.3 * (setting.filling_factor / 0.15) ** 4
    depth, stop = move(
        projectile.tip_radius, projectile.mass, setting.impact_speed, p_m, setting.strength_rate
    )
    time = np.linspace(0, 1.2 * stop, 161)
    phase = np.minimum(time / stop, 1.0) * math.pi / 2
    return DropRun(
        setting=setting,
        time=time,
        depth=depth * np.sin(phase),
        velocity=setting.impact_speed * np.cos(phase),
        force=np.zeros_like(time),
        shaft_work=np.zeros_like(time),
        penetration_depth=depth,
        stopping_time=stop,
        stopped=True,
        particles=make_dust(projectile.tip_radius, depth, setting.filling_factor),
        steps=1,
        rebuilds=0,
        wall=0.01,
        momentum_error=0.0,
        energy_error=0.0,
        energies={},
        viscous_share=0.0,
        solver="law",
    )


def make_dust(radius: float, depth: float, phi0: float) -> Particles:
    """Dust about a bead whose tip lies ``depth`` deep, denser near the tip."""
    step = radius / 8
    r, z = (each.ravel() for each in np.meshgrid((np.arange(32) + 0.5) * step, -(np.arange(56) + 0.5) * step))
    outside = np.hypot(r, z + depth - radius) > radius
    r, z = r[outside], z[outside]
    phi = phi0 + 0.1 * np.exp(-(r**2 + (z + depth) ** 2) / (1.2 * radius) ** 2)
    nothing = np.zeros_like(r)
    return Particles(
        r, z, 2 * np.pi * r * step**2, phi, np.full_like(r, phi0), nothing, nothing, nothing, nothing
    )


def write_campaign(
    folder: Path,
    *,
    drops: list[tuple[float, float, float]] = DROPS,
    rate: float = 0.0,
    bent: float = 0.0,
    seed: int = 7,
    name: str = "made up",
    description: str = "drops that obey a law",
    scan: bool = False,
) -> Path:
    """rate: strength_rate of the truth. bent: share of the depth by which all drops run ahead half way."""
    rng = np.random.default_rng(seed)
    folder.mkdir(parents=True)
    text = fill_in(CAMPAIGN, name=name, description=description)
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    for number, (radius, mass, speed) in enumerate(drops, start=1):
        depth, stop = move(radius * 1e-3, mass * 1e-6, speed, 1300.0, rate)
        at = folder / "drops" / f"D{number:02d}"
        at.mkdir(parents=True)
        height = speed**2 / 2 / 9.81
        text = fill_in(
            DROP,
            tip_radius_mm=radius,
            length_mm=6.0,
            mass_mg=mass,
            mass_sigma_mg=mass * 0.003,
            sequence=number,
            height_mm=round(height * 1e3, 4),
            height_sigma_mm=0.2,
            frame_rate_Hz=RATE,
            pixel_size_um=PIXEL * 1e6,
            surface_row_px=SURFACE,
            surface_row_sigma_px=0.1,
            row_sigma_px=NOISE,
        )
        (at / "drop.toml").write_text(text)
        frame = np.arange(int((0.004 + 1.6 * stop) * RATE))
        clock = frame / RATE - 0.00403
        phase = np.clip(clock / stop, 0, 1) * math.pi / 2
        inside = depth * (np.sin(phase) + bent * np.sin(2 * phase) ** 2)
        place = np.where(clock < 0, speed * clock + 0.5 * 9.81 * clock**2, inside)
        row = SURFACE + place / PIXEL + rng.normal(0, NOISE, frame.size)
        table = "".join(f"{k},{value:.4f}\n" for k, value in zip(frame, row, strict=True))
        (at / "track.csv").write_text("frame,tip_row_px\n" + table)
    if scan:
        write_scan(folder / "ct" / "C01")
    return folder


def write_scan(folder: Path) -> None:
    depth, _ = move(0.5e-3, 1.33e-6, 0.8, 1300.0)
    plain = Phantom()
    phantom = Phantom(centre=(54.3, 50.6, depth / plain.voxel - plain.radius + plain.surface))
    write_scan_of(phantom, folder)
