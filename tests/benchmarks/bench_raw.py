"""What becomes of a RAW photograph of sand under several ways to fill in its colours, in the same run.

    python tests/benchmarks/bench_raw.py [contrast ...]

Two simulated photographs (12 bits, 9,000 electrons at white, red and blue half and six tenths of green) look at one texture,
turned by 7 degrees and shifted. Each way makes the sum of the channels; all get the same arctangent filter, the same SIFT
(threshold 0.02 of the range) and the same ratio test. A match is right when it is within 1.5 pixels of the truth.
"""

from __future__ import annotations

import io
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import rawpy
from strandline.core.photographs.enhancement import enhance_photograph
from strandline.core.photographs.raw import SATURATION, decode_raw, summed
from strandline.core.photographs.reading import ChannelSum
from strandline.core.simulation.dng import save_dng
from strandline.core.simulation.exif import Metadata
from strandline.core.simulation.sensor import BLACK, WHITE

SIDE = 900
ANSWERS = (0.5, 1.0, 0.6)
FULL_WELL, READ_NOISE, LEVEL = 9000.0, 4.0, 0.45
NOBODY = Metadata("2024-03-12T10:00:00", 5.0, 43.0, 50.0, 50.0, 0.03, 0.05, 0.0, 1000.0)
PLAIN = {"user_wb": [1, 1, 1, 1], "output_bps": 16, "gamma": (1, 1), "no_auto_bright": True, "adjust_maximum_thr": 0.0}


def textures(contrast: float) -> list[np.ndarray]:
    """Return the albedo for each colour at twice the photographs' resolution: 1 / f, nearly grey."""
    size = 2 * SIDE + 400
    f = np.hypot(np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None])
    f[0, 0] = 1
    amplitude = np.where((f < 0.5) & (f > 1 / 300), 1 / f, 0)

    def field(seed: int) -> np.ndarray:
        noise = np.random.default_rng(seed).standard_normal((size, size))
        drawn = np.fft.irfft2(amplitude * np.fft.rfft2(noise), s=(size, size))
        return drawn / drawn.std()

    grey = field(1)
    return [np.exp(contrast * (np.sqrt(1 - 0.15**2) * grey + 0.15 * field(k + 2))) for k in range(3)]


def shot(albedo: list[np.ndarray], scene_from_pixel: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the mosaic of a photograph; ``scene_from_pixel`` is affine (2, 3)."""
    finer = scene_from_pixel.copy()
    finer[:, :2] /= 2
    finer[:, 2] += scene_from_pixel[:, :2] @ (-0.25, -0.25)
    seen = []
    for colour, answer in zip(albedo, ANSWERS, strict=True):
        wide = cv2.warpAffine(
            colour.astype(np.float32), finer, (2 * SIDE, 2 * SIDE), flags=cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        )
        wide = cv2.GaussianBlur(wide, (0, 0), 0.9)  # the lens
        seen.append(wide.reshape(SIDE, 2, SIDE, 2).mean((1, 3)) * answer * LEVEL * FULL_WELL)
    mosaic = seen[1].copy()
    mosaic[0::2, 0::2], mosaic[1::2, 1::2] = seen[0][0::2, 0::2], seen[2][1::2, 1::2]
    electrons = random.poisson(mosaic) + random.normal(0, READ_NOISE, mosaic.shape)
    return np.clip(np.rint(electrons / FULL_WELL * (WHITE - BLACK) + BLACK), 0, WHITE).astype(np.uint16)


def library(algorithm: rawpy.DemosaicAlgorithm | None) -> Callable[[bytes], np.ndarray]:
    """Return LibRaw's way."""

    def develop(data: bytes) -> np.ndarray:
        with rawpy.imread(io.BytesIO(data)) as raw:
            pixels = raw.postprocess(demosaic_algorithm=algorithm, output_color=rawpy.ColorSpace.raw, **PLAIN)
        return pixels.sum(axis=2, dtype=np.uint32)

    return develop


def main(contrasts: list[float]) -> None:
    """Print a table for each contrast."""
    ways = {"this engine": lambda data: summed(decode_raw(data))}
    ways |= {f"LibRaw {name}": library(getattr(rawpy.DemosaicAlgorithm, name)) for name in ("LINEAR", "PPG", "DHT")}
    ways["LibRaw default"] = library(None)  # adaptive homogeneity-directed
    cosine, sine = np.cos(np.radians(7)), np.sin(np.radians(7))
    maps = [np.array([[2.0, 0, 150], [0, 2.0, 150]]), np.array([[2 * cosine, -2 * sine, 280.3], [2 * sine, 2 * cosine, 129.3]])]
    for contrast in contrasts:
        random, albedo = np.random.default_rng(5), textures(contrast)
        mosaics = [shot(albedo, m, random) for m in maps] + [shot([np.ones_like(a) for a in albedo], maps[0], random)]
        with tempfile.TemporaryDirectory() as folder:
            files = []
            for k, mosaic in enumerate(mosaics):
                save_dng(Path(folder) / f"{k}.dng", mosaic, NOBODY)
                files.append((Path(folder) / f"{k}.dng").read_bytes())
        print(f"texture of {100 * contrast:g} %\n{'way':14s} noise %  matches   right  rms px  ms/megapixel")
        for name, way in ways.items():
            way(files[0])
            start = time.process_time()
            first, second, flat = (way(data) for data in files)
            spent = (time.process_time() - start) / 3 / (SIDE**2 / 1e6)
            found = []
            for total in (first, second):
                image = enhance_photograph(ChannelSum(total, 3, 3 * SATURATION, SATURATION / (WHITE - BLACK), True), "arctan")[0]
                found.append(cv2.SIFT_create(contrastThreshold=0.02).detectAndCompute(image, None))
            (points, a), (others, b) = found
            pairs = [(p, q) for p, q in cv2.BFMatcher().knnMatch(a, b, 2) if p.distance < 0.8 * q.distance]
            here = np.array([points[p.queryIdx].pt for p, _ in pairs]) @ maps[0][:, :2].T + maps[0][:, 2]
            there = np.array([others[p.trainIdx].pt for p, _ in pairs]) @ maps[1][:, :2].T + maps[1][:, 2]
            off = np.hypot(*(here - there).T) / 2
            right = off < 1.5
            inner = flat[20:-20, 20:-20]
            noise, rms = 100 * inner.std() / inner.mean(), np.sqrt((off[right] ** 2).mean())
            print(f"{name:14s} {noise:7.3f} {len(off):8d} {right.sum():7d} {rms:7.3f} {1000 * spent:13.1f}")


if __name__ == "__main__":
    main([float(word) for word in sys.argv[1:]] or [0.04, 0.012])
