"""CPU time and memory of ``dsmdifference`` beside a plain difference with rasterio and numpy, in the same run.

    python tests/benchmarks/bench_difference.py [side [zones]]

Both get the same pair: ``side`` x ``side`` cells of noise on two grids half a cell apart, and disks (four by default). The plain
peer reads both rasters whole, reprojects one onto the other's grid with GDAL's bilinear warp, sums the change in rasterised
polygons and writes a compressed GeoTIFF: no uncertainty, no level of detection, no shares of cells, no report, no overviews. It
is left out above 10,000 cells, where it would need 10 GB.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import rasterio
import shapely
from rasterio.features import rasterize
from rasterio.transform import Affine
from rasterio.warp import Resampling, reproject
from rasterio.windows import Window
from strandline.core.change.dsmdifference import Request, run
from strandline.core.contract import RasterSource, VectorSource
from strandline.core.vector import write_layer

WEST, NORTH, CELL = 300_000.0, 5_774_000.0, 0.05


def make(folder: Path, side: int, count: int) -> list[shapely.Geometry]:
    """Write the pair and the zones."""
    for seed, (name, shift, rise) in enumerate((("before", 0.0, 0.0), ("after", CELL / 2, 0.1))):
        random = np.random.default_rng(seed)
        place = Affine(CELL, 0, WEST + shift, 0, -CELL, NORTH - shift)
        profile = {"width": side, "height": side, "count": 1, "dtype": "float32", "crs": "EPSG:32755", "nodata": -9999.0}
        profile |= {"tiled": True, "blockxsize": 512, "blockysize": 512, "compress": "deflate", "zlevel": 1}
        with rasterio.open(folder / f"{name}.tif", "w", driver="GTiff", transform=place, **profile) as file:
            for row in range(0, side, 1024):
                rows = min(1024, side - row)
                strip = random.standard_normal((1, rows, side), np.float32) * np.float32(0.03) + np.float32(5 + rise)
                file.write(np.round(strip, 3), window=Window(0, row, side, rows))
    span, across = side * CELL, int(np.ceil(np.sqrt(count)))
    places = [((k % across + 0.5) / across, (k // across + 0.5) / across) for k in range(count)]
    zones = [shapely.Point(WEST + span * x, NORTH - span * y).buffer(span * 0.4 / across) for x, y in places]
    shapes = [shapely.multipolygons([z]) for z in zones]
    names = [f"zone {k + 1}" for k in range(count)]
    write_layer(str(folder / "zones.gpkg"), "zones", "EPSG:32755", {"name": names}, shapes, "MultiPolygon")
    return zones


def ours(folder: Path) -> float:
    """Run the step; return the net volume."""
    pair = (RasterSource(str(folder / "before.tif")), RasterSource(str(folder / "after.tif")))
    zones = VectorSource(str(folder / "zones.gpkg"), "zones")
    options = {"before_sigma": 0.03, "after_sigma": 0.03, "correlation_range": 5.0, "registration_sigma": 0.01}
    layers = {"zones": zones, "volumes": str(folder / "volumes.gpkg"), "significant": str(folder / "significant.tif")}
    return float(run(Request(*pair, str(folder / "ours.tif"), **layers, **options)).net or 0.0)


def plain(folder: Path, zones: list[shapely.Geometry]) -> float:
    """Do the same as one would by hand."""
    with rasterio.open(folder / "before.tif") as file:
        before, profile = file.read(1), file.profile
    with rasterio.open(folder / "after.tif") as file:
        after = np.full(before.shape, np.nan, np.float32)
        reproject(
            rasterio.band(file, 1),
            after,
            dst_transform=profile["transform"],
            dst_crs=profile["crs"],
            dst_nodata=np.nan,
            resampling=Resampling.bilinear,
        )
    change = after - np.where(before == profile["nodata"], np.nan, before)
    net = 0.0
    for zone in zones:
        inside = rasterize([zone], out_shape=change.shape, transform=profile["transform"]).astype(bool)
        net += float(np.nansum(change[inside])) * CELL**2
    profile.update(nodata=np.nan)
    with rasterio.open(folder / "plain.tif", "w", **profile) as file:
        file.write(change[None])
    return net


def peak_memory() -> float:
    """Return this process's own peak (MB); getrusage would count its parent's before the start."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def measure(which: str, folder: Path) -> None:
    """Print CPU seconds, peak memory (MB, beyond the libraries) and the net volume as JSON."""
    zones = [shapely.from_wkt(text) for text in json.loads((folder / "zones.json").read_text(encoding="utf-8"))]
    work = (lambda: ours(folder)) if which == "ours" else (lambda: plain(folder, zones))
    at_rest, start = peak_memory(), time.process_time()
    wall = time.perf_counter()
    net = work()
    used = {"cpu": time.process_time() - start, "wall": time.perf_counter() - wall}
    print(json.dumps({**used, "peak": peak_memory() - at_rest, "net": net}))


def main() -> None:
    """Make the pair, run both in processes of their own, print a table."""
    side = int(sys.argv[1]) if len(sys.argv) > 1 else 6000
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 4
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        zones = make(folder, side, count)
        (folder / "zones.json").write_text(json.dumps([z.wkt for z in zones]), encoding="utf-8")
        print(f"{side} x {side} cells, {count} zones\n{'':8}{'CPU s':>8}{'wall s':>8}{'peak MB':>10}{'net m3':>12}")
        for which in ("ours", "plain") if side <= 10_000 else ("ours",):
            done = subprocess.run([sys.executable, __file__, which, name], capture_output=True, text=True, check=True)
            found = json.loads(done.stdout.splitlines()[-1])
            print(f"{which:8}{found['cpu']:8.1f}{found['wall']:8.1f}{found['peak']:10.0f}{found['net']:12.3f}")


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[1] in ("ours", "plain"):
        measure(sys.argv[1], Path(sys.argv[2]))
    else:
        main()
