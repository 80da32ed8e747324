"""Static tests of the paper's dust: its curves (Güttler et al. 2009, eqs. 4 to 6), with noise."""

from pathlib import Path

import numpy as np

from labsim.records import StrengthTest

OMNIDIRECTIONAL = {"p_m": 13e3, "phi_1": 0.12, "phi_2": 0.58, "delta": 0.58}
UNIDIRECTIONAL = {"p_m": 5.6e3, "phi_1": 0.15, "phi_2": 0.33, "delta": 0.33}
TENSION = {"tensile_log10_a": 2.8, "tensile_log10_b": 1.48}
REACH = {
    "compression_omnidirectional": (0.14, 0.52),
    "compression_unidirectional": (0.16, 0.32),
    "tension": (0.15, 0.54),
    "shear": (0.15, 0.40),
}


def stress(kind: str, phi: np.ndarray, p_m: float = 13e3) -> np.ndarray:
    """Pa, by the paper's formulas and numbers; p_m : of compression from all sides, and of shear."""
    if kind == "compression_unidirectional":
        return 5.6e3 * ((phi - 0.15) / (0.33 - phi)) ** (0.33 * np.log(10))
    compressive = p_m * ((phi - 0.12) / (0.58 - phi)) ** (0.58 * np.log(10))
    tensile = 10 ** (2.8 + 1.48 * phi)
    return {"compression_omnidirectional": compressive, "tension": tensile}.get(
        kind, np.sqrt(compressive * tensile)
    )


def make_test(
    kind: str, seed: int, *, p_m: float = 13e3, sigma: float = 0.05, rows: int = 25
) -> StrengthTest:
    rng = np.random.default_rng(seed)
    phi = np.linspace(*REACH[kind], rows)
    seen = stress(kind, phi, p_m) * np.exp(sigma * rng.standard_normal(rows))
    return StrengthTest(f"S{seed:02d}", kind, tuple(zip(phi.tolist(), seen.tolist(), strict=True)), sigma)  # type: ignore[arg-type]


def write_test(folder: Path, test: StrengthTest) -> Path:
    """As a campaign has it; the folder of the test."""
    place = folder / "strength" / test.name
    place.mkdir(parents=True)
    rows = "".join(f"{phi:.6f},{pressure / 1e3:.6f}\n" for phi, pressure in test.points)
    (place / "curve.csv").write_text("phi,pressure\n" + rows)
    (place / "strength.toml").write_text(
        f'[test]\nkind = "{test.kind}"\nfile = "curve.csv"\nfilling_factor_column = "phi"\n'
        f'pressure_column = "pressure"\npressure_unit = "kPa"\nrelative_sigma = {test.relative_sigma}\n'
    )
    return place
