"""Every format gives the same slices; logs of several writers are read; bad input is one line each."""

import bz2
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
import tifffile
from PIL import Image

from benchmarks.truths.phantom import Phantom
from labsim.ct import open_stack, reduce_scan
from labsim.ct.formats.images import read_image, read_rescale
from labsim.ct.slices.reconstruct import (
    absorb,
    find_centre,
    find_centre_of_mass,
    find_symmetry_axis,
    linearise,
    read_projections,
    reconstruct_parallel,
)
from labsim.ct.slices.skyscan import read_log
from labsim.errors import MeasurementError

DATA = Path(__file__).parents[2] / "data" / "ct"
SLICES = np.random.default_rng(0).integers(0, 60000, (12, 20, 24)).astype(np.uint16)


def write_folder(folder, suffix, slices):
    folder.mkdir()
    for k, image in enumerate(slices):
        file = folder / f"dust_rec{k:08d}{suffix}"
        if suffix == ".tif":
            tifffile.imwrite(file, image)
        else:
            Image.fromarray(image).save(file)
    return folder


@pytest.mark.parametrize("suffix", [".tif", ".png", ".bmp"])
def test_folders(tmp_path, suffix):
    slices = SLICES if suffix != ".bmp" else (SLICES // 256).astype(np.uint8)
    folder = write_folder(tmp_path / "s", suffix, slices)
    (folder / "dust_rec_spr.bmp").write_bytes(b"a preview")
    assert np.array_equal(np.stack(list(open_stack(folder))), slices)


def test_multipage_tiff_and_hdf5(tmp_path):
    tifffile.imwrite(tmp_path / "pages.tif", SLICES, photometric="minisblack")
    tifffile.imwrite(tmp_path / "imagej.tif", SLICES, imagej=True)
    with h5py.File(tmp_path / "volume.h5", "w") as file:
        file["exchange/data"] = SLICES
    for name in ("pages.tif", "imagej.tif", "volume.h5"):
        assert np.array_equal(np.stack(list(open_stack(tmp_path / name))), SLICES), name


LOG = """[System]
Scanner=SkyScan1172
[Acquisition]
Filename Prefix=dust
Image Pixel Size (um)=20.0
[Reconstruction]
Filename Prefix=dust_rec
Pixel Size (um)={size}
Sections Count={count}
Result File Type={kind}
Result Image Width (pixels)=24
Result Image Height (pixels)=20
Beam Hardening Correction (%)={hardening}
{minimum} for CS to Image Conversion={low}
Maximum for CS to Image Conversion= 0.180000
BMP LUT={lut}
HU Calibration={hu}
Section to Section Step=1
"""
FACTS = {
    "size": "40.0",
    "count": "12",
    "kind": "TIF(16 bit)",
    "hardening": "0",
    "minimum": "Minimum",
    "low": "0.0",
    "lut": "0",
    "hu": "OFF",
}


def write_log(path, text=None, encoding="utf-8", **changes):
    path.write_bytes((text or LOG.format(**{**FACTS, **changes})).encode(encoding))
    return path


def read_range(log):
    """Attenuation of grey 0 and of the top level."""
    return tuple(
        log.number(f"{end} for CS to image conversion", "reconstruction") for end in ("minimum", "maximum")
    )


def test_six_logs(tmp_path):
    new = read_log(write_log(tmp_path / "a.log"))
    assert new.voxel == pytest.approx(40e-6) and read_range(new) == (0.0, 0.18)
    assert new.text("filename prefix", "acquisition") == "dust"
    assert new.text("Filename Prefix", "reconstruction") == "dust_rec"
    typo = read_log(write_log(tmp_path / "b.log", minimum="Mininum", low="-0.482", hu="ON (65535)"))
    assert read_range(typo) == (-0.482, 0.18) and typo.switch("hu calibration") is True
    old = read_log(
        write_log(tmp_path / "c.log", "[Acquisition]\r\nIMAGE PIXEL SIZE (UM)= 37,5\r\nNote=a=b\r\n")
    )
    assert (
        old.voxel == pytest.approx(37.5e-6) and old.text("note") == "a=b" and read_range(old) == (None, None)
    )
    latin = read_log(
        write_log(tmp_path / "d.log", LOG.format(**FACTS) + "Operator=Gürtler µ\n", encoding="latin-1")
    )
    assert latin.text("operator") == "Gürtler µ"
    roi = read_log(
        write_log(
            tmp_path / "e.log", LOG.format(**FACTS) + "Reconstruction from ROI=ON\nROI Top (pixels)=901.5\n"
        )
    )
    assert roi.switch("reconstruction from roi") and roi.number("roi top (pixels)") == 901.5
    missing = read_log(write_log(tmp_path / "f.log", "[System]\nScanner=SkyScan1074\n"))
    assert missing.voxel is None and missing.slice_spacing is None
    with pytest.raises(MeasurementError, match="no \\[section\\]"):
        read_log(write_log(tmp_path / "g.log", "not a log"))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"count": "13"}, "Sections Count: is 13 but there are 12"),
        ({"kind": "BMP"}, "Result File Type: is BMP but the slices have 16 bits"),
        ({"lut": "1"}, "BMP LUT"),
    ],
)
def test_a_log_that_contradicts_the_images(tmp_path, changes, words):
    folder = write_folder(tmp_path / "s", ".tif", SLICES)
    write_log(folder / "dust_rec.log", **changes)
    with pytest.raises(MeasurementError, match=words):
        open_stack(folder)


def test_a_log_gives_voxel_and_warnings(tmp_path):
    folder = write_folder(tmp_path / "s", ".tif", SLICES)
    write_log(folder / "dust_rec.log", hardening="51", hu="ON (65535)")
    stack = open_stack(folder)
    assert stack.voxel == pytest.approx(40e-6)
    assert any("51 %" in text for text in stack.warnings) and any("HU" in text for text in stack.warnings)


def complaint(scan):
    with pytest.raises(MeasurementError) as caught:
        reduce_scan(scan)
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_bad_scans_are_one_line_each(tmp_path):
    phantom = Phantom(noise=0.005)
    grey = phantom.grey()
    scan = phantom.write(tmp_path / "good", grey=grey)
    assert "upside down" in complaint(replace(scan, first_slice="bottom"))
    assert "scan.bits" in complaint(replace(scan, bits=8))
    assert "does not exist" in complaint(replace(scan, slices=tmp_path / "nowhere"))
    radius = replace(scan.projectile, tip_radius=1.5 * scan.projectile.tip_radius)
    assert "radius_mm" in complaint(replace(scan, projectile=radius))
    (tmp_path / "good" / "slice_0050.tif").rename(tmp_path / "away.tif")
    assert "missing or doubled between slice_0049.tif and slice_0051.tif" in complaint(scan)
    tifffile.imwrite(tmp_path / "good" / "slice_0050.tif", grey[50][:-4])
    assert "slice_0050.tif: is 104 x 100 pixels" in complaint(scan)
    (tmp_path / "good" / "slice_0050.tif").write_bytes(b"no image")
    assert "slice_0050.tif" in complaint(scan)


def test_no_bead_two_beads_and_a_cut_one(tmp_path):
    phantom = Phantom(noise=0.005)
    grey = phantom.grey()
    dust = np.repeat(np.repeat(grey[:, :, :1], 104, 2), 1, 1)
    assert "no bead" in complaint(phantom.write(tmp_path / "none", grey=dust))
    wide = np.concatenate([grey, grey], axis=2)
    assert "2 bright bodies" in complaint(phantom.write(tmp_path / "two", grey=wide))
    assert "cut by the edge" in complaint(phantom.write(tmp_path / "cut", grey=grey[:, :, 50:]))


def test_a_calibration_that_cannot_be(tmp_path):
    scan = Phantom(noise=0.005).write(tmp_path / "s")
    air = replace(scan.calibration, grey_air=scan.calibration.grey_air * 2)
    assert "undisturbed dust" in complaint(replace(scan, calibration=air))


def test_real_slice_has_air_at_zero():
    file = DATA / "aluminium_slices" / "recon_Al_00389.tif"
    scale = read_rescale(file)
    air = np.median(scale["slope"] * read_image(file).astype(float) + scale["offset"])
    assert abs(air) <= 0.001


def test_centre_of_real_projections():
    attenuation, angles = read_projections(DATA / "tooth" / "tooth.h5")
    assert find_centre(attenuation[0], attenuation[-1]) == pytest.approx(296, abs=1)
    assert find_centre_of_mass(attenuation, angles) == pytest.approx(296, abs=1)


def test_symmetry_axis_of_a_real_image():
    image = np.loadtxt(bz2.open(DATA / "o2_image" / "O2-ANU1024.txt.bz2"))
    rows = image.sum(0)
    mirror = [np.correlate(rows, rows[::-1], "full")]  # the peak of the autoconvolution is twice the axis
    peak = int(np.argmax(mirror[0]))
    a, b, c = mirror[0][peak - 1 : peak + 2]
    axis = (peak + 0.5 * (a - c) / (a - 2 * b + c)) / 2
    assert find_symmetry_axis(image) == pytest.approx(axis, abs=0.5)


def test_linearised_beam_hardening():
    """15-40 keV, attenuation falling as E^-2.8 with a Compton floor: a disc of 25 mm of dust and a denser spot."""
    from skimage.transform import radon

    n, size = 128, 25.0e-3
    y, x = np.mgrid[:n, :n] - n / 2 + 0.5
    phi = 0.15 * (np.hypot(x, y) < 0.45 * n) + 0.08 * (np.hypot(x, y) < 0.45 * n) * np.exp(
        -(x**2 + y**2) / (2 * 10.0**2)
    )
    angles = np.linspace(0, np.pi, 180, endpoint=False)
    path = radon(phi, np.rad2deg(angles), circle=True).T * (size / n)  # m of solid
    energy = np.linspace(15, 40, 26)
    mu = 2.0 * 100 * (2.38 * (20 / energy) ** 2.8 + 0.17)  # 1/m of silica
    weight = np.exp(-(((energy - 26) / 7) ** 2))

    def measure(length):
        return -np.log((np.exp(-mu * length[..., None]) * weight).sum(-1) / weight.sum())

    wedge = np.linspace(1e-5, path.max() * 1.1, 40)
    one = reconstruct_parallel(path, angles, n // 2, size / n)
    raw = reconstruct_parallel(
        measure(path) * (1e-4 / measure(np.array([1e-4]))[0]), angles, n // 2, size / n
    )
    straight = reconstruct_parallel(linearise(measure(path), measure(wedge), wedge), angles, n // 2, size / n)
    middle = np.hypot(x, y) < 0.35 * n
    assert np.abs(straight - one)[middle].max() <= 0.002
    assert np.abs(raw - one)[middle].max() > 0.005
    assert np.abs(straight - phi)[middle].mean() <= 0.002


def test_absorb():
    assert absorb(np.array([30.0]), np.array([110.0]), np.array([10.0]))[0] == pytest.approx(np.log(5))


def test_cone_beam_needs_astra():
    from labsim.ct.slices.reconstruct import reconstruct_cone

    try:
        import astra  # noqa: F401
    except ImportError:
        with pytest.raises(MeasurementError, match="pip install astra-toolbox"):
            reconstruct_cone(np.zeros((4, 5, 6)), np.zeros(4), 1e-4, 0.1, 0.1)
    else:
        pytest.skip("ASTRA is installed; its FDK needs a GPU that this test does not ask for")
