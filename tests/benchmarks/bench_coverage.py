"""How often the interval of a net volume holds the truth, on simulated pairs of surfaces.

    python tests/benchmarks/bench_coverage.py [pairs [seed]]

Each pair is a beach of 120 x 160 m on cells of 1 m, the later model on a grid of its own a fraction of a cell beside the first.
Drawn anew for each: white noise and noise that is alike over 2 to 40 m (one range or two), a bias, a tilt, a shift in plan of 1 m
in any direction, the place, size and relief of stable ground, sigmas given as rasters (different from place to place) or not at
all, and what the sea took and left. Zones are a disk, a long strip, an L and two boxes that touch; all of them are a sixth. The
naive interval takes the cells as independent, with their true sigma.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyogrio
import rasterio
import shapely
from numpy.typing import NDArray
from rasterio.transform import Affine
from strandline.core.change.dsmdifference import Request, Result, run
from strandline.core.change.variogram import correlation
from strandline.core.change.zones import cell_shares
from strandline.core.contract import RasterSource, VectorSource
from strandline.core.progress import Progress
from strandline.core.raster import Grid
from strandline.core.vector import write_layer

Array = NDArray[np.float64]
UTM, WEST, NORTH = "EPSG:32755", 300_000.0, 5_774_000.0
HEIGHT, WIDTH, SIDE = 120, 160, 320
ZONES = {
    "disk": shapely.Point(60, -60).buffer(18),
    "strip": shapely.box(15, -108, 110, -102),
    "L": shapely.union(shapely.box(20, -95, 28, -25), shapely.box(20, -33, 60, -25)),
    "box": shapely.box(85, -70, 100, -50),
    "touching box": shapely.box(100, -80, 112, -50),
}
STABLE = {
    "strip behind": [shapely.box(125, -118, 150, -2)],
    "small": [shapely.box(125, -80, 140, -40)],
    "two sides": [shapely.box(125, -118, 140, -2), shapely.box(2, -118, 12, -2)],
    "all around": [shapely.box(120, -118, 158, -2), shapely.box(2, -118, 12, -2), shapely.box(12, -20, 120, -2)],
}


@dataclass(frozen=True)
class Case:
    """What was drawn: where stable ground lies and whether it has relief, whether sigmas are given, and the errors (m)."""

    stable: str
    relief: bool
    given: bool
    white: float
    structures: tuple[tuple[float, float], ...]
    tilt: float

    @classmethod
    def draw(cls, random: np.random.Generator) -> Case:
        """Draw a case."""
        ranges = np.exp(random.uniform(np.log(2.0), np.log(40.0), 1 + int(random.integers(2))))
        structures = tuple((float(random.uniform(0.01, 0.03)), float(reach)) for reach in ranges)
        stable = tuple(STABLE)[int(random.integers(len(STABLE)))]
        relief, given = (bool(v) for v in random.integers(0, 2, 2))
        return cls(stable, relief, given, float(random.uniform(0.01, 0.03)), structures, float(random.uniform(0.0, 5e-4)))


def terrain(x: Array, y: Array, relief: bool) -> Array:
    """Return a beach that falls to the west, with berm and cusps, and dunes or flat ground behind and around it."""
    beach = 3.0 + 0.04 * (np.minimum(x, 115.0) - 60.0) + 0.3 * np.exp(-(((x - 75.0) / 8.0) ** 2)) + 0.1 * np.sin(y / 7.0)
    if not relief:
        return beach
    return beach + np.where(x > 115, 0.5, 0.15) * np.sin((x + 0.4 * y) / 3.0) * np.sin((y - 0.2 * x) / 4.0)


def moved(x: Array, y: Array, size: Array) -> Array:
    """Return the change: a bar that came, a scarp that went; none on stable ground."""
    inside = (x > 14) & (x < 118) & (y < -22)
    bar = size[0] * np.exp(-(((x - 30.0) / 12.0) ** 2))
    scarp = size[1] * np.exp(-(((x - 80.0) / 15.0) ** 2) - ((y + 60.0) / 40.0) ** 2)
    return np.asarray(np.where(inside, bar + scarp + size[2] * np.sin(x / 9.0) * np.cos(y / 11.0), 0.0))


def correlated(random: np.random.Generator, reach: float) -> Array:
    """Return a field (HEIGHT, WIDTH) of unit variance and the spherical model's correlation."""
    i = np.minimum(np.arange(SIDE), SIDE - np.arange(SIDE))
    spectrum = np.sqrt(np.maximum(np.fft.fft2(correlation(np.hypot(i[:, None], i[None]), reach)).real, 0.0))
    return np.asarray(np.fft.ifft2(np.fft.fft2(random.standard_normal((SIDE, SIDE))) * spectrum).real[:HEIGHT, :WIDTH])


class Simulator:
    """Writes pairs into a folder, runs the step, and scores its zones."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.grid = Grid(WEST, NORTH, 1.0, WIDTH, HEIGHT, UTM)
        self.zones = {name: shapely.transform(shape, lambda xy: xy + (WEST, NORTH)) for name, shape in ZONES.items()}
        self._layer("zones", list(self.zones.values()), {"name": list(self.zones)})
        for name, shapes in STABLE.items():
            self._layer(
                name, [shapely.transform(s, lambda xy: xy + (WEST, NORTH)) for s in shapes], {"id": list(range(len(shapes)))}
            )
        self.shares = []
        for shape in [*self.zones.values(), shapely.union_all(list(self.zones.values()))]:
            row, column, part = cell_shares(shape, self.grid) or (0, 0, np.zeros((0, 0)))
            whole = np.zeros((HEIGHT, WIDTH))
            whole[row : row + part.shape[0], column : column + part.shape[1]] = part
            self.shares.append(whole)

    def _layer(self, name: str, shapes: list[shapely.Geometry], fields: dict[str, list[object]]) -> None:
        parts = [shapely.multipolygons(shapely.get_parts(s)) for s in shapes]
        write_layer(str(self.folder / f"{name}.gpkg"), name, UTM, fields, parts, "MultiPolygon")

    def _source(self, name: str) -> VectorSource:
        return VectorSource(str(self.folder / f"{name}.gpkg"), name)

    def _raster(self, name: str, values: Array, offset: float = 0.0) -> RasterSource:
        profile = {"width": WIDTH, "height": HEIGHT, "count": 1, "dtype": "float32", "crs": UTM}
        place = Affine(1.0, 0, WEST + offset, 0, -1.0, NORTH - offset)
        path = self.folder / f"{name}.tif"
        with rasterio.open(path, "w", driver="GTiff", transform=place, **profile) as file:
            file.write(values.astype(np.float32)[None])
        return RasterSource(str(path))

    def pair(self, random: np.random.Generator, case: Case) -> tuple[dict[str, RasterSource], Array]:
        """Write a pair; return its rasters by the request's names, and the true net volume of each zone and of all (m3)."""
        rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
        offset = float(random.uniform(0.0, 0.9))
        angle, bend = random.uniform(0.0, 2 * np.pi, 2)
        plan = np.cos(angle), np.sin(angle)
        size = random.uniform(-0.6, 0.6, 3)
        # A sigma that doubles over the beach, as it does where the sand is dull.
        noisy = 1.0 + 0.5 * np.sin(columns / 25.0 + bend) if case.given else np.ones((HEIGHT, WIDTH))
        total = np.sqrt(case.white**2 + sum(s * s for s, _ in case.structures))
        sources = {}
        for name, start in (("before", 0.0), ("after", offset)):
            x, y = columns + start, -rows - start
            if name == "after":
                heights = terrain(x - plan[0], y - plan[1], case.relief) + moved(x - plan[0], y - plan[1], size)
                tilt = random.uniform(0.0, 2 * np.pi)
                heights = heights + random.normal(0, 0.1) + case.tilt * (np.cos(tilt) * (x - 80) + np.sin(tilt) * (y + 60))
            else:
                heights = terrain(x, y, case.relief)
            noise = case.white * random.standard_normal(heights.shape)
            for sill, reach in case.structures:
                noise += sill * correlated(random, reach)
            sources[name] = self._raster(name, heights + noisy * noise, start)
            if case.given:
                sources[f"{name}_precision"] = self._raster(f"{name}_precision", noisy * total, start)
        change = moved(columns, -rows, size)
        return sources, np.array([float((share * change).sum()) for share in self.shares])

    def scores(self, random: np.random.Generator, case: Case) -> tuple[Array, Array, list[str]]:
        """Return error over sigma (zones and all of them), the same for independent cells, and the warnings."""
        sources, truth = self.pair(random, case)
        table, listener = str(self.folder / "volumes.gpkg"), Listener()
        layers = {"stable": self._source(case.stable), "zones": self._source("zones"), "volumes": table}
        result = run(Request(output=str(self.folder / "change.tif"), **sources, **layers), Progress(listener))
        net, sigma = _nets(table, result)
        total = np.sqrt(2 * (case.white**2 + sum(s * s for s, _ in case.structures)))
        naive = total * np.sqrt([float((share**2).sum()) for share in self.shares])
        return (net - truth) / sigma, (net - truth) / naive, listener.warnings


class Listener:
    """Remembers warnings."""

    def __init__(self) -> None:
        self.warnings: list[str] = []

    def fraction(self, value: float) -> None:
        """Ignore it."""

    def message(self, text: str, *, warning: bool) -> None:
        """Keep a warning."""
        if warning:
            self.warnings.append(text)

    def cancelled(self) -> bool:
        """Never."""
        return False


def _nets(table: str, result: Result) -> tuple[Array, Array]:
    meta, _, _, columns = pyogrio.raw.read(table)
    rows = dict(zip(meta["fields"], columns, strict=True))
    whole = (np.nan if v is None else v for v in (result.net, result.net_sigma))
    net, sigma = (np.append(rows[key], value).astype(float) for key, value in zip(("net", "sigma"), whole, strict=True))
    return net, sigma


def kind_of(warnings: list[str]) -> str:
    """Return what a pair counts as: its sigmas as told, a bound, or told to leave out a tilt."""
    if any("too small to resolve" in text for text in warnings):
        return "range not resolved"
    return "tilt not known" if any("NET_SIGMA leaves it out" in text for text in warnings) else "resolved"


def main() -> None:
    """Simulate, and print the shares of intervals that hold the truth."""
    pairs = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    found: list[tuple[str, Case, Array, Array]] = []
    start = time.process_time()
    with tempfile.TemporaryDirectory() as name:
        simulator = Simulator(Path(name))
        for k in range(pairs):
            random = np.random.default_rng([seed, k])
            case = Case.draw(random)
            scores, naive, warnings = simulator.scores(random, case)
            found.append((kind_of(warnings), case, scores, naive))
    print(f"{pairs} pairs, seed {seed}, {time.process_time() - start:.0f} s CPU")
    print(f"{'':34}{'pairs':>6}{'68 %':>8}{'95 %':>8}{'rms':>7}   naive 68 %, 95 %")
    groups = {kind: [f for f in found if f[0] == kind] for kind in ("resolved", "range not resolved", "tilt not known")}
    groups |= {f"resolved, stable {s}": [f for f in groups["resolved"] if f[1].stable == s] for s in STABLE}
    for word in (True, False):
        groups[f"resolved, {'dunes' if word else 'flat'}"] = [f for f in groups["resolved"] if f[1].relief == word]
        groups[f"resolved, {'rasters' if word else 'no sigma'}"] = [f for f in groups["resolved"] if f[1].given == word]
    for name, few in groups.items():
        if few:
            print(row(name, np.array([f[2] for f in few]), np.array([f[3] for f in few])))
    some = groups["resolved"]
    for i, name in enumerate([*ZONES, "all"]):
        print(row(f"resolved, zone {name}", np.array([f[2][i : i + 1] for f in some]), np.array([f[3][i : i + 1] for f in some])))


def row(name: str, scores: Array, naive: Array) -> str:
    """Return a line of the table."""
    inside = [100 * float(np.mean(np.abs(s) < limit)) for s in (scores, naive) for limit in (0.99446, 1.95996)]
    spread = float(np.sqrt(np.mean(scores**2)))
    return f"{name:34}{len(scores):6}{inside[0]:8.1f}{inside[1]:8.1f}{spread:7.2f}   {inside[2]:.1f}, {inside[3]:.1f}"


if __name__ == "__main__":
    main()
