"""The filter itself, against hand-computed numbers and a brute-force reference."""

import math

import numpy as np
import pytest
from strandline.core.photographs.enhancement import (
    enhance_photograph,
    equalized_table,
    micmac_tables,
    noise_floor,
    pixel_noise,
    reflected,
)
from strandline.core.photographs.reading import channel_sum, mean_level


def grey(values, dtype=np.uint8):
    return channel_sum(np.array(values, dtype))


def reference(values, window, floor, mode):
    """Local contrast in (-1, 1) with every window summed on its own, in float64."""
    half = window // 2
    padded = np.pad(values.astype(float), half, mode=mode)
    out = np.empty(values.shape)
    for r in range(values.shape[0]):
        for c in range(values.shape[1]):
            w = padded[r : r + window, c : c + window]
            sigma = max(math.sqrt(np.mean((w - w.mean()) ** 2)), floor)
            out[r, c] = math.atan((values[r, c] - w.mean()) / sigma) / (math.pi / 2)
    return out


def test_one_bright_pixel_by_hand():
    # A window of 3 over one 9 among zeros: mean 1, variance 81/9 - 1 = 8; at the pixel z = 8 / sqrt(8) = sqrt(8), beside it
    # z = -1 / sqrt(8). atan(sqrt(8)) = 1.230959, atan(1 / sqrt(8)) = 0.339837. Far away: 0, which is 127.5, rounded to 128.
    values = np.zeros((7, 7), np.uint8)
    values[3, 3] = 9
    out, _ = enhance_photograph(grey(values), "arctan", 3)
    assert out[3, 3] == math.floor(127.5 + 127.5 * 1.230959 / 1.570796 + 0.5) == 227
    assert out[3, 2] == out[2, 2] == math.floor(127.5 - 127.5 * 0.339837 / 1.570796 + 0.5) == 100
    assert out[3, 5] == out[0, 0] == 128


def test_the_floor_holds_where_the_window_is_flatter():
    # One 2 among zeros: mean 2/9, variance 4/9 - 4/81 = 32/81, sigma 0.6285 < 1 DN. z = 16/9: atan = 1.058407.
    values = np.zeros((5, 5), np.uint8)
    values[2, 2] = 2
    out, contrast = enhance_photograph(grey(values), "arctan", 3)
    assert out[2, 2] == math.floor(127.5 + 127.5 * 1.058407 / 1.570796 + 0.5) == 213
    assert noise_floor(1) == 1.0
    assert noise_floor(3) == pytest.approx(1.7320508)
    assert contrast.below_percent == 100.0


@pytest.mark.parametrize(("dtype", "top", "channels"), [(np.uint8, 256, 1), (np.uint8, 256, 3), (np.uint16, 65536, 3)])
def test_arctan_against_brute_force(dtype, top, channels):
    rng = np.random.default_rng(1)
    pixels = rng.integers(0, top, (23, 31, channels)).astype(dtype)
    total = channel_sum(pixels)
    expected = 127.5 + 127.5 * reference(pixels.sum(2, dtype=np.int64), 11, math.sqrt(channels), "symmetric")
    out, _ = enhance_photograph(total, "arctan", 11)
    # Half a level of rounding, and the polynomial's 2e-5.
    assert np.abs(out - expected).max() < 0.5 + 1e-4


def test_micmac_against_brute_force():
    rng = np.random.default_rng(2)
    pixels = rng.integers(0, 200, (20, 26, 3)).astype(np.uint8)
    total = channel_sum(pixels)
    values = pixels.sum(2, dtype=np.int64)
    flat = np.sort(values.ravel())
    levels, counts = np.unique(flat, return_counts=True)
    share = {v: (flat <= v).mean() for v in levels}
    roots = {v: np.sqrt(counts[levels <= v]).sum() / np.sqrt(counts).sum() for v in levels}
    tone = np.vectorize(lambda v: 255 * (share[v] + 2 * v / flat[-1] + 3 * roots[v]) / 6)(values)
    margin = np.minimum(64, np.minimum(tone, 255 - tone))
    expected = tone + margin * reference(values, 5, math.sqrt(3), "edge")
    out, _ = enhance_photograph(total, "micmac", 5)
    difference = expected - out  # truncated, not rounded
    assert difference.min() > -1e-3
    assert difference.max() < 1 + 1e-3


def test_micmac_tables_by_hand():
    # Values 0, 0, 0, 0, 2, 4 : H = 4/6, 5/6, 1; L = 0, 1/2, 1; S = 2/4, 3/4, 1.
    tone, margin = micmac_tables(np.array([[0, 0, 0], [0, 2, 4]], np.uint16))
    assert tone[[0, 2, 4]] == pytest.approx([255 * (4 / 6 + 0 + 1.5) / 6, 255 * (5 / 6 + 1 + 2.25) / 6, 255.0], rel=1e-6)
    assert margin[[0, 2, 4]] == pytest.approx([64.0, 64.0, 0.0], abs=1e-4)


def test_equalize_by_hand():
    table = equalized_table(np.array([[0, 0, 3], [3, 3, 7]], np.uint16))
    assert [table[0], table[3], table[7]] == [85, 213, 255]  # 255 * 2/6, 255 * 5/6 = 212.5 rounded up, 255


def test_none_is_the_mean_of_the_channels():
    pixels = np.array([[[0, 0, 0], [1, 2, 3], [1, 1, 2], [255, 255, 255]]], np.uint8)
    assert mean_level(channel_sum(pixels)).tolist() == [[0, 2, 1, 255]]
    assert mean_level(grey([[0, 32768, 65535]], np.uint16)).tolist() == [[0, 128, 255]]
    out, contrast = enhance_photograph(grey([[7, 9], [11, 200]]), "none")
    assert out.tolist() == [[7, 9], [11, 200]]
    assert contrast.mean_sigma is None


@pytest.mark.parametrize("value", [0, 1, 128, 255])
def test_a_constant_image_becomes_mid_grey(value):
    out, contrast = enhance_photograph(grey(np.full((40, 30), value)), "arctan", 9)
    assert (out == 128).all()
    assert contrast.mean_sigma == 0.0


def test_gain_and_offset_do_not_matter_away_from_the_floor():
    rng = np.random.default_rng(3)
    dim = rng.normal(60.0, 6.0, (50, 60)).round().astype(np.uint16)
    bright = dim.astype(np.int64) * 600 + 5000
    assert bright.max() < 65536
    before, after = (enhance_photograph(grey(v, np.uint16), "arctan", 21)[0].astype(int) for v in (dim, bright))
    assert np.abs(after - before).max() <= 1  # where a value lies on the border of two levels
    assert (after != before).mean() < 1e-3


def test_sand_of_16_bits_keeps_its_signal():
    # 3 DN of texture on 60,000: its squares differ in the tenth digit, where float32 has none.
    rng = np.random.default_rng(4)
    texture = rng.integers(-5, 6, (64, 64))
    low, _ = enhance_photograph(grey(100 + texture, np.uint16), "arctan", 15)
    high, _ = enhance_photograph(grey(60000 + texture, np.uint16), "arctan", 15)
    assert np.abs(low.astype(int) - high).max() <= 1  # variance good to 1e-5 of 10 DN^2: a rounding at most
    assert low.std() > 40


def test_the_sum_of_channels_keeps_more_than_an_8_bit_luma():
    # Texture of 0.3 DN with the noise of three channels: the luma rounds most of it away.
    rng = np.random.default_rng(5)
    texture = np.kron(rng.normal(0.0, 0.3, (25, 25)), np.ones((6, 6)))
    pixels = np.round(120.0 + texture[:, :, None] + rng.normal(0.0, 0.3, (150, 150, 3))).astype(np.uint8)
    luma = np.round(pixels @ np.array([0.114, 0.587, 0.299])).astype(np.uint8)

    def likeness(image):
        return np.corrcoef(image.ravel().astype(float), texture.ravel())[0, 1]

    total = channel_sum(pixels)
    assert len(np.unique(total.values)) > len(np.unique(luma))
    assert likeness(enhance_photograph(total, "arctan", 51)[0]) > likeness(enhance_photograph(grey(luma), "arctan", 51)[0]) + 0.05


def test_reflection_repeats_the_edge_pixel():
    assert reflected(4, 2).tolist() == [1, 0, 0, 1, 2, 3, 3, 2]
    assert reflected(3, 3).tolist() == [2, 1, 0, 0, 1, 2, 2, 1, 0]


def test_noise_of_a_pixel():
    # Immerkaer's operator on white noise of 5 DN, blind to the slope; its own scatter is 0.5 % here.
    rng = np.random.default_rng(6)
    noisy = 300 + np.arange(400)[:, None] * 0.5 + rng.normal(0.0, 5.0, (400, 1000))
    assert pixel_noise(noisy.round().astype(np.uint16)) == pytest.approx(math.hypot(5.0, math.sqrt(1 / 12)), rel=0.02)


def test_statistics_are_those_of_the_window():
    # Chequered 0 and 10 in a window of 3: 4 or 5 of 9 pixels are 10, variance 100 * 20/81 either way.
    rows, columns = np.indices((33, 40))
    _, contrast = enhance_photograph(grey((rows + columns) % 2 * 10), "arctan", 3)
    assert contrast.below_percent == 0.0
    assert contrast.mean_sigma == pytest.approx(10 * math.sqrt(20 / 81), rel=0.02)  # the border's windows are a little other
