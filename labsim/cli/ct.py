"""``labsim ct``: slices become a filling-factor map and its compacted volume."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import CampaignError, LabsimError
from ..records import Scan
from . import options
from ._many import Item, finish_many, measure_many
from .options import AsJson, Out, Pictures, Quiet, finish, make_output_folder, show_progress, write_json

OPTIONS = {  # of what slices without scan.toml need
    "voxel_um": "--voxel-um",
    "grey_air": "--grey-air",
    "grey_per_density": "--grey-per-density",
    "density_solid_kg_m3": "--density-solid",
    "radius_mm": "--bead-radius-mm",
    "mass_mg": "--bead-mass-mg",
}


def ct(
    scan: Annotated[
        Path,
        typer.Argument(
            help="Folder of one scan, with its scan.toml; a whole campaign; or slices: a folder of images, a TIFF, an HDF5 file."
        ),
    ],
    out: Out = None,
    voxel_um: Annotated[float | None, typer.Option("--voxel-um", help="Edge of a voxel.")] = None,
    first_slice: Annotated[
        str | None, typer.Option("--first-slice", help='Where the first slice lies: "top" or "bottom".')
    ] = None,
    bits: Annotated[
        int | None, typer.Option("--bits", help="Depth of the slices, 8 or 16. Default: the file's.")
    ] = None,
    grey_air: Annotated[float | None, typer.Option("--grey-air", help="Grey level of air.")] = None,
    grey_per_density: Annotated[
        float | None, typer.Option("--grey-per-density", help="Grey levels per kg/m³.")
    ] = None,
    density_solid: Annotated[
        float | None, typer.Option("--density-solid", help="Density of the grains' own material, kg/m³.")
    ] = None,
    bead_radius_mm: Annotated[
        float | None, typer.Option("--bead-radius-mm", help="Radius of the bead.")
    ] = None,
    bead_mass_mg: Annotated[float | None, typer.Option("--bead-mass-mg", help="Mass of the bead.")] = None,
    sample_filling_factor: Annotated[
        float | None,
        typer.Option("--filling-factor", help="Of the sample as prepared; a check of the calibration only."),
    ] = None,
    cell: Annotated[int, typer.Option("--cell", min=1, max=20, help="Voxels along an edge of a cell.")] = 2,
    guard: Annotated[
        float, typer.Option("--guard", min=0, help="Voxels about the bead that are left out.")
    ] = 3.0,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    pictures: Pictures = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Reduce a CT scan: slices to an axisymmetric map of the filling factor and its compacted volume.

    What scan.toml would say can be given as options: all of it for slices without one, or single values that stand over it.
    """
    from ..campaign_scans import complete_stack, read_sample_alone, read_scan, read_scans

    tables: dict[str, dict[str, Any]] = {
        "projectile": {"radius_mm": bead_radius_mm, "mass_mg": bead_mass_mg},
        "scan": {"voxel_um": voxel_um, "first_slice": first_slice, "bits": bits},
        "calibration": {
            "grey_air": grey_air, "grey_per_density": grey_per_density, "density_solid_kg_m3": density_solid,
        },
    }  # fmt: skip
    stated = {
        name: {key: value for key, value in values.items() if value is not None}
        for name, values in tables.items()
    }
    if (scan / "campaign.toml").is_file():
        if any(stated.values()):
            raise LabsimError("command line", "--voxel-um …", "belong to one scan; name its folder")
        sample, scans = read_scans(scan)
        if not scans:
            raise CampaignError(scan / "ct", "", "holds no scan with slices; there is nothing to reduce")
        given: dict[str, Any] = {
            "cell": cell,
            "guard": guard,
            "sample": sample_filling_factor or sample.filling_factor,
        }
        items = [Item(each.name, scan / "ct" / each.name, given) for each in scans]
        target = make_output_folder(out, scan, "ct")
        with show_progress(quiet) as progress:
            found = measure_many(
                reduce_one,
                "scan.json",
                items,
                target,
                workers=workers,
                scheduler=scheduler,
                progress=progress,
            )
        finish_many(found, target / "scans.json", _describe_shortly, as_json=as_json, quiet=quiet)
        return
    record = read_scan(scan, given=complete_stack(scan, stated, OPTIONS), speed_required=False)
    if not isinstance(record, Scan):
        raise CampaignError(
            scan, "scan.slices", "gives published figures, not slices; there is nothing to reduce"
        )
    folder = scan.resolve() if scan.is_dir() else scan.resolve().parent
    campaign = folder.parent.parent
    if sample_filling_factor is None and (campaign / "campaign.toml").is_file():
        sample_filling_factor = read_sample_alone(campaign).filling_factor
    target = make_output_folder(out, scan, "ct")
    given = {"cell": cell, "guard": guard, "sample": sample_filling_factor}
    with show_progress(quiet) as progress:
        summary, lines = reduce_record(record, target, given, progress)
    finish(
        {**summary, "out": str(target)},
        f"{lines}\nwritten to {options.shorten_path(target)}",
        as_json=as_json,
        quiet=quiet,
        folder=target,
    )


def reduce_one(
    source: Path, target: Path, given: dict[str, Any], progress: options.Progress | None = None
) -> tuple[dict[str, Any], str]:
    """Files of one scan of a campaign; its summary and the lines for people."""
    from ..campaign_scans import read_scan

    record = read_scan(source, speed_required=False)
    assert isinstance(record, Scan)
    return reduce_record(record, target, given, progress)


def reduce_record(
    record: Scan, target: Path, given: dict[str, Any], progress: options.Progress | None = None
) -> tuple[dict[str, Any], str]:
    """Files of one scan; its summary and the lines for people."""
    from ..ct import compress, reduce_scan, summarise_scan, write_compressed, write_map
    from ..report.figures.maps import draw_compressed, draw_map

    began = time.perf_counter()
    reduced = reduce_scan(
        record,
        cell=given["cell"],
        guard=given["guard"],
        sample_filling_factor=given["sample"],
        progress=progress or (lambda done, total, text: None),
    )
    curve = compress(reduced.map)
    summary = summarise_scan(reduced, curve)
    summary["wall_s"] = time.perf_counter() - began
    write_map(reduced, target / "map.nc")
    write_compressed(curve, target / "compressed_volume.csv")
    draw_map(reduced.map, reduced.undisturbed.value, target / "map.png", record.name)
    draw_compressed(curve, target / "compressed_volume.png", record.name)
    write_json(target / "scan.json", summary)
    return summary, describe(summary)


def _describe_shortly(name: str, summary: dict) -> str:
    return (
        f"{name}: tip {summary['tip_depth_m'] * 1e3:.3f} mm deep, undisturbed {summary['filling_factor_undisturbed']:.4f}, "
        f"denser than 0.20: {summary['compacted_volume_sphere_volumes']:.2f} sphere volumes"
    )


def describe(summary: dict) -> str:
    """What a person reads at the end."""
    x, y = summary["axis_px"]
    sphere = summary["normalisation"]["sphere_volume_m3"]
    sigma = summary["compacted_volume_sigma_m3"]
    ledger = summary["mass_ledger_m3"]
    lean = [1e3 * t for t in summary["tilt_rad"]]
    phi, phi_sigma = summary["filling_factor_undisturbed"], summary["filling_factor_undisturbed_sigma"]
    lines = [
        f"axis at pixel ({x:.2f}, {y:.2f}), leaning {lean[0]:+.1f}, {lean[1]:+.1f} mrad "
        f"(± {1e3 * summary['tilt_sigma_rad']:.1f})",
        f"tip {summary['tip_depth_m'] * 1e3:.3f} mm below the undisturbed surface",
        f"undisturbed filling factor {phi:.5f} ± {phi_sigma:.5f}",
        f"denser than 0.20: {summary['compacted_volume_m3'] * 1e9:.3f} ± {sigma * 1e9:.3f} mm³ = "
        f"{summary['compacted_volume_sphere_volumes']:.2f} ± {sigma / sphere:.2f} sphere volumes",
        f"voxel noise {summary['voxel_noise']:.4f}, point spread {summary['blur_m'] * 1e6:.0f} µm",
        f"dust displaced {ledger['displaced'] * 1e9:.3f} mm³, found compacted {ledger['compacted'] * 1e9:.3f}, "
        f"heaped {ledger['heaped'] * 1e9:.3f}",
    ]
    lines += [f"note: {text}" for text in summary["warnings"]]
    return "\n".join(lines)
