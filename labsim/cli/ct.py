"""``labsim ct``: slices become a filling-factor map and its compacted volume."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from ..errors import CampaignError
from ..records import Campaign, Scan
from . import options
from ._many import Item, finish_many, measure_many
from .options import AsJson, Out, Quiet, finish, make_output_folder, show_progress, write_json


def ct(
    scan: Annotated[
        Path, typer.Argument(help="Folder of one scan, with its scan.toml, or a whole campaign.")
    ],
    out: Out = None,
    cell: Annotated[int, typer.Option("--cell", min=1, max=20, help="Voxels along an edge of a cell.")] = 2,
    guard: Annotated[
        float, typer.Option("--guard", min=0, help="Voxels about the bead that are left out.")
    ] = 3.0,
    workers: options.Workers = None,
    scheduler: options.Scheduler = None,
    quiet: Quiet = False,
    as_json: AsJson = False,
) -> None:
    """Reduce a CT scan: slices to an axisymmetric map of the filling factor and its compacted volume."""
    from ..campaign import read_campaign, read_scan

    if (scan / "campaign.toml").is_file():
        read = read_campaign(scan)
        given = {"cell": cell, "guard": guard, "sample": read.sample.filling_factor}
        items = [Item(each.name, scan / "ct" / each.name, given) for each in _list_scans(read)]
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
    record = read_scan(scan)
    if not isinstance(record, Scan):
        raise CampaignError(
            scan, "scan.slices", "gives published figures, not slices; there is nothing to reduce"
        )
    folder = scan.resolve() if scan.is_dir() else scan.resolve().parent
    campaign = folder.parent.parent
    sample = read_campaign(campaign).sample.filling_factor if (campaign / "campaign.toml").is_file() else None
    target = make_output_folder(out, scan, "ct")
    with show_progress(quiet) as progress:
        summary, lines = reduce_one(scan, target, {"cell": cell, "guard": guard, "sample": sample}, progress)
    finish({**summary, "out": str(target)}, f"{lines}\nwritten to {target}", as_json=as_json, quiet=quiet)


def reduce_one(
    source: Path, target: Path, given: dict[str, Any], progress: options.Progress | None = None
) -> tuple[dict[str, Any], str]:
    """Files of one scan; its summary and the lines for people."""
    from ..campaign import read_scan
    from ..ct import compress, reduce_scan, summarise_scan, write_compressed, write_map
    from ..report.map_figures import draw_compressed, draw_map

    began = time.perf_counter()
    record = read_scan(source)
    assert isinstance(record, Scan)
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


def _list_scans(campaign: Campaign) -> tuple[Scan, ...]:
    if not campaign.scans:
        raise CampaignError(
            campaign.folder / "ct", "", "holds no scan with slices; there is nothing to reduce"
        )
    return campaign.scans


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
