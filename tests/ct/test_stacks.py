"""Slices given as they are: one file, options in place of scan.toml, damaged, hostile or endless files."""

import json
import struct
import time
from dataclasses import replace

import h5py
import numpy as np
import pytest
import tifffile

from benchmarks.truths.phantom import Phantom
from labsim.campaign_scans import read_sample_alone, read_scan, read_scans
from labsim.cli import main
from labsim.ct import open_stack, reduce_scan
from labsim.errors import CampaignError, LabsimError, MeasurementError
from labsim.tiff_pages import count_pages
from labsim.video import open_frames

PHANTOM = Phantom(noise=0.005)
TOML = """[projectile]
shape = "sphere"
radius_mm = {radius}
mass_mg = {mass}
{drop}
[scan]
slices = "{slices}"
voxel_um = 37.0
first_slice = "top"
bits = 16
[calibration]
grey_air = {air}
grey_per_density = {per_density}
density_solid_kg_m3 = 2000.0
"""


@pytest.fixture(scope="module")
def grey():
    return PHANTOM.grey()


def write_toml(folder, slices, drop=""):
    c, bead = PHANTOM.calibration, PHANTOM.scan(folder).projectile
    (folder / "scan.toml").write_text(
        TOML.format(
            radius=bead.tip_radius * 1e3, mass=bead.mass * 1e6, slices=slices, drop=drop,
            air=c.grey_air, per_density=c.grey_per_density,
        )
    )  # fmt: skip


def write_stack(file, grey):
    if file.suffix == ".h5":
        with h5py.File(file, "w") as stream:
            stream["exchange/data"] = grey
    else:
        tifffile.imwrite(file, grey, photometric="minisblack")
    return file


def run(capsys, *arguments):
    with pytest.raises(SystemExit) as left:
        main(["ct", *map(str, arguments), "--quiet"])
    caught = capsys.readouterr()
    return left.value.code, caught.out, caught.err


OPTIONS = {
    "--voxel-um": 37.0,
    "--grey-air": PHANTOM.calibration.grey_air,
    "--grey-per-density": PHANTOM.calibration.grey_per_density,
    "--density-solid": 2000.0,
    "--bead-radius-mm": PHANTOM.radius * PHANTOM.voxel * 1e3,
    "--bead-mass-mg": 2540.0 * 4 / 3 * np.pi * (PHANTOM.radius * PHANTOM.voxel) ** 3 * 1e6,
}


@pytest.mark.parametrize("name", ["stack.tif", "tooth.h5"])
def test_a_file_of_slices_from_scan_toml_and_from_options(tmp_path, capsys, grey, name):
    scan = tmp_path / "C01"
    scan.mkdir()
    file = write_stack(scan / name, grey)
    write_toml(scan, name)  # no [drop]: a reduction needs no speed
    out = tmp_path / "toml"
    assert run(capsys, scan, "-o", out) == (0, "", "")
    first = json.loads((out / "scan.json").read_text())
    flat = [text for option in OPTIONS.items() for text in map(str, option)]
    out = tmp_path / "options"
    assert run(capsys, file, "-o", out, *flat)[0] == 0
    second = json.loads((out / "scan.json").read_text())
    for key in ("tip_depth_m", "filling_factor_undisturbed", "compacted_volume_m3"):
        assert first[key] == pytest.approx(second[key], rel=1e-9)
    depth = (PHANTOM.centre[2] + PHANTOM.radius - PHANTOM.surface) * PHANTOM.voxel
    assert first["tip_depth_m"] == pytest.approx(depth, abs=0.1 * PHANTOM.voxel)


def test_a_folder_of_slices_with_options_and_one_value_over_scan_toml(tmp_path, capsys, grey):
    PHANTOM.write(tmp_path / "C01" / "slices", grey=grey)
    flat = [text for option in OPTIONS.items() for text in map(str, option)]
    assert run(capsys, tmp_path / "C01" / "slices", "-o", tmp_path / "a", *flat)[0] == 0
    write_toml(tmp_path / "C01", "slices")
    status, _, text = run(capsys, tmp_path / "C01", "-o", tmp_path / "b", "--voxel-um", "5000")
    assert status == 2 and "voxel_um" in text and "outside" in text


def test_all_missing_options_are_named_at_once(tmp_path, capsys, grey):
    file = write_stack(tmp_path / "tooth.h5", grey)
    status, _, text = run(capsys, file, "--voxel-um", "37")
    assert status == 2 and text.count("\n") == 1 and "UTF-8" not in text
    for option in OPTIONS:
        assert (option in text) == (option != "--voxel-um")
    with pytest.raises(CampaignError, match=r"scan\.toml: is missing"):
        read_scan(file)


def test_a_scan_is_reduced_before_the_drops_are_filled_in(tmp_path, capsys, grey):
    scan = tmp_path / "camp" / "ct" / "C01"
    PHANTOM.write(scan / "slices", grey=grey)
    write_toml(scan, "slices")
    drop = tmp_path / "camp" / "drops" / "D01"
    drop.mkdir(parents=True)
    (drop / "drop.toml").write_text("not filled in")
    (tmp_path / "camp" / "campaign.toml").write_text(
        "[sample]\nfilling_factor = 0.15\nfilling_factor_sigma = 0.001\nmonomer_density_kg_m3 = 2000.0\n"
        "diameter_mm = 25.0\ndepth_mm = 20.0\ngas_pressure_Pa = 0.0\n"
    )
    assert run(capsys, scan, "-o", tmp_path / "one")[0] == 0
    assert run(capsys, tmp_path / "camp", "-o", tmp_path / "all", "--workers", "1")[0] == 0
    assert read_sample_alone(tmp_path / "camp").filling_factor == 0.15
    assert [each.name for each in read_scans(tmp_path / "camp")[1]] == ["C01"]


def test_a_folder_with_one_file_of_many_slices_says_to_name_it(tmp_path, grey):
    write_stack(tmp_path / "stack.tif", grey)
    with pytest.raises(MeasurementError, match=r"name the file itself: .*stack\.tif"):
        open_stack(tmp_path)


def test_an_empty_slice_is_named_before_anything_is_read(tmp_path, grey):
    PHANTOM.write(tmp_path / "slices", grey=grey)
    write_toml(tmp_path, "slices")
    (tmp_path / "slices" / "slice_0060.tif").write_bytes(b"")
    with pytest.raises(CampaignError, match=r"slice_0060\.tif is empty"):
        read_scan(tmp_path, speed_required=False)


@pytest.mark.parametrize("kind", ["tif", "deflate", "png"])
def test_a_truncated_slice_is_named(tmp_path, grey, kind):
    from PIL import Image

    folder = tmp_path / "slices"
    folder.mkdir()
    for k, image in enumerate(grey):
        name = folder / f"slice_{k:04d}.{'png' if kind == 'png' else 'tif'}"
        if kind == "png":
            Image.fromarray(image).save(name)
        else:
            tifffile.imwrite(name, image, compression="zlib" if kind == "deflate" else None)
    file = sorted(folder.iterdir())[60]
    file.write_bytes(file.read_bytes()[:-3000])
    with pytest.raises(LabsimError, match="slice_0060") as caught:
        reduce_scan(PHANTOM.scan(folder))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["slices", "stack.tif", "volume.h5"])
def test_a_float_slice_that_is_not_finite_is_named(tmp_path, grey, wrong, name):
    floats = grey.astype(np.float32)
    floats[5, 3, 4] = wrong  # in the air, which nothing but the artefacts' median ever met
    if name == "slices":
        scan = PHANTOM.write(tmp_path / name, grey=floats)
    else:
        scan = PHANTOM.scan(write_stack(tmp_path / name, floats))
    with pytest.raises(MeasurementError, match=r"slice.*5.*not finite"):
        reduce_scan(scan)


def endless(file):
    """A TIFF of one page whose directory is followed by itself."""
    pixels = np.zeros((8, 8), np.uint8)
    tifffile.imwrite(file, pixels)
    data = bytearray(file.read_bytes())
    first = struct.unpack_from("<I", data, 4)[0]
    entries = struct.unpack_from("<H", data, first)[0]
    struct.pack_into("<I", data, first + 2 + 12 * entries, first)
    file.write_bytes(data)
    return file


def test_a_tiff_without_end_is_refused_by_both_readers(tmp_path, grey):
    file = endless(tmp_path / "endless.tif")
    PHANTOM.write(tmp_path / "slices", grey=grey)
    endless(tmp_path / "slices" / "slice_0000.tif")
    began = time.monotonic()
    for read in (count_pages, open_stack, open_frames):
        with pytest.raises(LabsimError, match="without end"):
            read(file)
    with pytest.raises(LabsimError, match=r"slice_0000\.tif.*without end"):
        open_stack(tmp_path / "slices")
    assert time.monotonic() - began < 10


def test_pages_are_counted_in_all_kinds_of_tiff(tmp_path):
    pictures = np.zeros((9, 12, 14), np.uint16)
    for options in ({}, {"bigtiff": True}, {"byteorder": ">"}, {"bigtiff": True, "byteorder": ">"}):
        tifffile.imwrite(tmp_path / "a.tif", pictures, photometric="minisblack", **options)
        assert count_pages(tmp_path / "a.tif") == 9, options
    whole = (tmp_path / "a.tif").read_bytes()
    for length in range(0, len(whole), 97):
        (tmp_path / "cut.tif").write_bytes(whole[:length])
        try:
            assert 0 < count_pages(tmp_path / "cut.tif") <= 9
        except MeasurementError:
            pass


def bomb(file, side):
    """A picture of side x side zeros, packed a thousandfold."""
    tifffile.imwrite(file, np.zeros((side, side), np.uint8), rowsperstrip=500, compression="zlib")
    return file.read_bytes()


@pytest.mark.parametrize("side", [20000, 5000])
def test_slices_that_would_fill_the_memory_are_refused_before_they_are_unpacked(tmp_path, side):
    data = bomb(tmp_path / "one.tif", side)
    folder = tmp_path / "slices"
    folder.mkdir()
    for k in range(60):
        (folder / f"slice_{k:03d}.tif").write_bytes(data)
    began = time.monotonic()
    with pytest.raises(LabsimError, match=r"pixels, more than|would unpack to"):
        reduce_scan(replace(PHANTOM.scan(folder), bits=8))
    assert time.monotonic() - began < 10
    if side == 20000:
        with pytest.raises(LabsimError, match="more than"):
            open_frames(tmp_path / "one.tif")


def test_a_damaged_hdf5_file_is_one_line(tmp_path):
    """A byte too many among its inner tables, in one place after the other: the stack reads, or the file is named."""
    sound = write_stack(tmp_path / "sound.h5", np.arange(8 * 16 * 16, dtype=np.uint16).reshape(8, 16, 16))
    content = sound.read_bytes()
    refused = 0
    for at in range(0, 2048, 16):
        file = tmp_path / "damaged.h5"
        file.write_bytes(content[:at] + b"\x5a" + content[at:])
        try:
            stack = open_stack(file)
            for k in range(stack.count):
                stack.slice(k)
        except MeasurementError as trouble:
            refused += 1
            assert "\n" not in str(trouble) and "damaged.h5" in str(trouble)
    assert refused > 20
