"""Where noise overtakes texture, from the covariances of the colours."""

import cv2
import numpy as np
import pytest
from strandline.core.photographs.raw import RawPhotograph, colours
from strandline.core.photographs.reading import channel_sum
from strandline.core.photographs.signal import PERIOD, STRIP, block_means, crossover, strip_starts
from strandline.core.simulation import sensor

TINT = np.array([1.1, 1.0, 0.8])


def texture(shape, seed=1):
    """A field whose power falls with the frequency to the power of 2.4, and is 1 per pixel at 1 cycle per pixel."""
    rng = np.random.default_rng(seed)
    f = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None])
    f[0, 0] = np.inf
    return np.fft.irfft2(np.fft.rfft2(rng.normal(size=shape)) * f**-1.2, shape)


def means_of(pixels):
    return np.stack([block_means(pixels[top : top + STRIP]) for top in strip_starts(len(pixels))])


def coloured(frequency, shape=(1000, 1400), seed=2):
    """Three tints of one texture, each with noise of its own, that as a sum have the same power at ``frequency``."""
    rng = np.random.default_rng(seed)
    own = np.array([2.0, 1.0, 1.5])  # standard deviations of the noise: their squares add up to 7.25
    level = np.sqrt((own**2).sum()) / TINT.sum() * frequency**1.2
    pixels = 1000 + level * texture(shape)[:, :, None] * TINT + rng.normal(size=(*shape, 3)) * own
    taps = np.array([0.25, 0.5, 0.25])  # of demosaicing
    return cv2.sepFilter2D(pixels, -1, taps, taps)


def test_means_by_hand():
    # Four blocks of 4 columns side by side and what is left of the columns; the mean of 0 .. 3 is 1.5.
    strip = np.zeros((STRIP, 21, 1)) + np.arange(21)[:, None]
    assert block_means(strip).shape == (16, 4, 1)
    assert (block_means(strip)[:, :, 0] == [1.5, 5.5, 9.5, 13.5]).all()
    assert list(strip_starts(STRIP)) == [0]
    assert list(strip_starts(PERIOD + STRIP)) == [0, PERIOD]
    assert list(strip_starts(STRIP - 1)) == []


@pytest.mark.parametrize("frequency", [0.15, 0.2, 0.3])
def test_the_crossover_is_found(frequency):
    # Some 30,000 differences, of which the finer band tells S/N to a tenth: f to 4 %; the calm nine tenths bias it a little.
    assert crossover(means_of(coloured(frequency)), 0.01) == pytest.approx(frequency, rel=0.12)


def test_masked_ground_does_not_count():
    pixels = coloured(0.15)
    valid = np.ones(pixels.shape[:2], bool)
    valid[:, 700:] = False
    spoiled = pixels.copy()
    spoiled[:, 700:] += 50 * np.random.default_rng(3).normal(size=(1000, 700, 3))
    told = crossover(means_of(spoiled), 0.01, valid)
    assert told == pytest.approx(0.15, rel=0.15)
    assert told == crossover(means_of(np.where(valid[:, :, None], pixels, 0.0)), 0.01, valid)
    assert crossover(means_of(spoiled), 0.01) is None  # more noise than texture in all that can be told
    assert crossover(means_of(pixels), 0.01, np.zeros_like(valid)) is None


def test_what_cannot_be_told():
    pixels = coloured(0.15)
    assert crossover(means_of(pixels[:, :, :1]), 0.01) is None  # one colour
    assert crossover(means_of(np.repeat(pixels[:, :, :1], 3, axis=2)), 0.01) is None  # copies of one
    assert crossover(means_of(pixels[:80, :80]), 0.01) is None  # a stamp
    assert crossover(channel_sum(np.zeros((300, 300, 3), np.uint8)).means, 1.0) is None  # not asked for


def test_no_texture_or_colours_that_share_none():
    assert crossover(means_of(coloured(0.05)), 0.01) is None
    plants = np.stack([texture((1000, 1400), seed) for seed in (6, 7, 8)], axis=-1)
    assert crossover(means_of(10 * plants), 0.01) is None


def test_the_noise_of_a_sensor():
    # Light of known contrast through the sensor's own photon transfer: the noise of the sum per pixel, as white noise, is what
    # each colour's samples have, over the share of pixels that are of that colour.
    light = np.zeros((3, 1000, 1400), np.float32)
    relief = texture((1000, 1400))
    electrons = np.array(sensor.sand_electrons())
    variance = ((electrons + sensor.READ_NOISE**2) / np.array([0.25, 0.5, 0.25])).sum()
    frequency = 0.15
    contrast = np.sqrt(variance * frequency**2.4) / electrons.sum()
    light[0] = 1 + contrast * relief
    mosaic = sensor.expose(light, 1.0, 1.0, np.random.default_rng(5))
    raw = RawPhotograph(mosaic, sensor.PATTERN, np.full((2, 2), float(sensor.BLACK)), sensor.WHITE, np.ones(3))
    # Vignetting takes up to an eighth of the light; the bands lie within 12 % as above.
    assert crossover(means_of(colours(raw)), raw.step) == pytest.approx(frequency, rel=0.15)
    # The JPG of the same light has the same noise, as far as its colours tell: to a third.
    assert crossover(means_of(sensor.develop(mosaic)), 1.0) == pytest.approx(frequency, rel=0.33)
