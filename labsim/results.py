"""What a command wrote, read again for scripts and notebooks: ``labsim.load(OUT)``."""

from __future__ import annotations

import html
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import LabsimError
from .text_files import load_json

if TYPE_CHECKING:  # pragma: no cover
    import pandas as pd
    import xarray as xr

    from .report.figures.axes import Axes

# summary file -> what it is of, its table and its grid; where a folder has several, the first stands for it
KINDS = {
    "diagnosis.json": ("diagnosis", None, "posterior.nc"),
    "calibration.json": ("calibration", None, "posterior.nc"),
    "run.json": ("run", "curve.csv", None),
    "drop.json": ("track", "curve.csv", None),
    "scan.json": ("scan", "compressed_volume.csv", "map.nc"),
    "strength.json": ("static tests", None, None),
    "tracks.json": ("tracks", None, None),
    "scans.json": ("scans", None, None),
}
SAID = "summary.txt"  # what the command said on the terminal


@dataclass(frozen=True, repr=False)
class Result:
    """An output folder of labsim.

    Attributes
    ----------
    folder : Path
        The folder that the command wrote.
    kind : str
        "diagnosis", "calibration", "run", "track", "scan", "static tests", "tracks" or "scans".
    data : dict
        The summary file as it stands, SI.
    """

    folder: Path
    kind: str
    data: dict[str, Any]
    table: str | None
    grid: str | None

    def __repr__(self) -> str:
        return f"<labsim {self.kind} in {self.folder}{self._say_shortly()}>"

    def _repr_html_(self) -> str:
        return f"<p><b>{html.escape(repr(self)[1:-1])}</b></p><pre>{html.escape(self.summary())}</pre>"

    def _say_shortly(self) -> str:
        if self.kind == "diagnosis":
            causes = self.data.get("causes") or [{}]
            named = " + ".join(causes[0].get("causes", []))
            return f": {self.data.get('verdict')}, {named} with probability {causes[0].get('probability', 0.0):.3g}"
        if self.kind == "calibration":
            p_m = self.data["p_m_Pa"]
            return f": p_m = {p_m['mean'] / 1e3:.3g} ± {p_m['sd'] / 1e3:.2g} kPa"
        depth = self.data.get("penetration_depth_m")
        return f": {depth * 1e3:.3g} mm deep" if isinstance(depth, float) else ""

    def summary(self) -> str:
        """What the command said on the terminal. Raises LabsimError where it did not keep it."""
        file = self.folder / SAID
        if not file.is_file():
            raise LabsimError(file, "", "is missing; labsim rerun makes the result again")
        return file.read_text(encoding="utf-8").rstrip()

    def to_dataframe(self) -> pd.DataFrame:
        """A pandas table, SI with units in the names of its columns.

        Of a track or a run the curve, of a scan the compacted volume, of a calibration or diagnosis the draws of the posterior.
        """
        import pandas as pd

        if self.table is not None:
            return pd.read_csv(self._find(self.table))
        if self.grid is not None:
            draws = self.to_xarray()
            return pd.DataFrame({str(name): values.values.ravel() for name, values in draws.items()})
        raise LabsimError(self.folder, self.kind, "holds no table; data has its numbers")

    def to_xarray(self) -> xr.Dataset:
        """Of a scan the map of the filling factor over z and r (m), of a calibration or diagnosis the chains of the posterior."""
        import xarray as xr

        if self.grid is None:
            raise LabsimError(self.folder, self.kind, "holds no grid; to_dataframe() gives its table")
        group = "posterior" if self.grid == "posterior.nc" else None
        with xr.open_dataset(self._find(self.grid), engine="h5netcdf", group=group) as opened:
            return opened.load()

    def plot_curve(self, ax: Axes | None = None) -> Axes:
        """Depth (mm) against time (ms) of a track, with its band of one sigma, or of a run."""
        from .report.figures.axes import plot_depth

        if self.table != "curve.csv":
            raise LabsimError(self.folder, self.kind, "has no curve; a track or a run has")
        return plot_depth(self.to_dataframe(), ax)

    def plot_map(self, ax: Axes | None = None) -> Axes:
        """Filling factor of a scan about its axis, mm."""
        from .report.figures.axes import plot_filling_factor

        if self.grid != "map.nc":
            raise LabsimError(self.folder, self.kind, "has no map; a scan has")
        return plot_filling_factor(self.to_xarray(), ax)

    def plot_posterior(self, name: str = "p_m_Pa", ax: Axes | None = None) -> Axes:
        """Posterior density of one parameter of a calibration or diagnosis. name : a column of ``to_dataframe``."""
        from .report.figures.axes import plot_density

        if self.grid != "posterior.nc":
            raise LabsimError(self.folder, self.kind, "has no posterior; a calibration or a diagnosis has")
        draws = self.to_dataframe()
        if name not in draws:
            raise LabsimError(self.folder, name, f"is no parameter; choose one of {', '.join(draws)}")
        return plot_density(draws[name].to_numpy(), name, ax)

    def _find(self, name: str) -> Path:
        file = self.folder / name
        if not file.is_file():
            raise LabsimError(file, "", "is missing; the command did not write it, or it was moved")
        return file


def load(folder: Path | str) -> Result:
    """Read the output folder of a command again.

    Parameters
    ----------
    folder : Path or str
        What ``labsim track``, ``ct``, ``strength``, ``simulate``, ``calibrate`` or ``diagnose`` wrote.

    Returns
    -------
    Result

    Raises
    ------
    LabsimError
        Where the folder holds no result.
    """
    folder = Path(folder)
    for name, (kind, table, grid) in KINDS.items():
        if (folder / name).is_file():
            data = load_json(folder / name, LabsimError, "name the output folder of a command")
            if not isinstance(data, dict):
                raise LabsimError(folder / name, "", "is no summary; name the output folder of a command")
            return Result(folder, kind, data, table, grid)
    raise LabsimError(folder, "load", f"holds no result of labsim ({', '.join(KINDS)})")
