"""The filter itself, against hand-computed numbers and a brute-force reference."""

import math
from dataclasses import replace

import numpy as np
import pytest
from strandline.core.photographs.bandpass import Band, band_of, band_passed
from strandline.core.photographs.enhancement import (
    enhance_photograph,
    equalized_table,
    micmac_tables,
    noise_floor,
    pixel_noise,
    reflected,
    usable,
)
from strandline.core.photographs.reading import channel_sum, mean_level


def grey(values, dtype=np.uint8):
    return channel_sum(np.array(values, dtype))


def reference(values, window, floor, mode, valid=None):
    """Local contrast in (-1, 1) with every window summed on its own, in float64; NaN where a quarter of it is not valid."""
    half = window // 2
    padded = np.pad(values.astype(float), half, mode=mode)
    there = np.pad(np.ones(values.shape, bool) if valid is None else valid, half, mode=mode)
    out = np.full(values.shape, np.nan)
    for r in range(values.shape[0]):
        for c in range(values.shape[1]):
            m = there[r : r + window, c : c + window]
            if m.mean() < 0.25 or not there[r + half, c + half]:
                continue
            w = padded[r : r + window, c : c + window][m]
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
    assert noise_floor(3, 16.0) == pytest.approx(27.712813)
    assert contrast.below_percent == 100.0


def sand(bits, channels=3, shape=(37, 45), seed=1):
    """Dim sand with 2 % of contrast beside a field of everything from black to white, as a camera of ``bits`` has it."""
    rng = np.random.default_rng(seed)
    white = 2**bits - 1
    pixels = rng.normal(0.3, 0.006, (*shape, channels)) * white
    pixels[:, : shape[1] // 3] = rng.uniform(0, white, (shape[0], shape[1] // 3, channels))
    return pixels.round().clip(0, white).astype(np.uint8 if bits == 8 else np.uint16)


def a_mask(shape):
    """A corner, a hole, and a region that leaves a narrow tongue of pixels whose windows are mostly masked."""
    valid = np.ones(shape, bool)
    valid[:20, :11] = False
    valid[25:29, 30:36] = False
    valid[:, -9:] = False
    valid[18, -9:] = True
    return valid


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize("window", [3, 11, 25, 37])
@pytest.mark.parametrize(("bits", "channels"), [(8, 1), (8, 3), (12, 3), (16, 3)])
def test_arctan_against_brute_force(bits, channels, window, masked):
    pixels = sand(bits, channels)
    total = channel_sum(pixels)
    valid = a_mask(total.values.shape) if masked else None
    local = reference(total.values, window, math.sqrt(channels), "symmetric", valid)
    out, contrast = enhance_photograph(total, "arctan", window, valid)
    defined = ~np.isnan(local)
    # Half a level of rounding, and the polynomial's 2e-5.
    assert np.abs(out - (127.5 + 127.5 * local))[defined].max() < 0.5 + 1e-4
    assert (out[~defined] == 128).all()
    if masked:
        assert (usable(valid, "arctan", window) == defined).all()
        assert contrast.masked_percent == pytest.approx(100 * (~defined).mean())
        if window == 11:  # the windows of the tongue's end
            assert (~defined).sum() > (~valid).sum()


def gaussian_mean(values, sigma, reach, valid=None):
    """A Gaussian mean cut at ``reach`` pixels, each window summed on its own, of valid pixels."""
    weights = np.exp(-(np.arange(-reach, reach + 1) ** 2) / (2 * sigma**2)) if reach else np.ones(1)
    weights = np.outer(weights, weights)
    padded = np.pad(values.astype(float), reach, mode="symmetric")
    there = np.pad(np.ones(values.shape) if valid is None else valid, reach, mode="symmetric")
    out, side = np.zeros(values.shape), 2 * reach + 1
    for r in range(values.shape[0]):
        for c in range(values.shape[1]):
            w = weights * there[r : r + side, c : c + side]
            out[r, c] = (w * padded[r : r + side, c : c + side]).sum() / max(w.sum(), 1e-300)
    return out


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize(("bits", "window"), [(8, 11), (12, 25), (16, 37)])
def test_bandpass_against_brute_force(bits, window, masked):
    # So small a photograph tells nothing of its noise: the first Gaussian has 1 px, and the second the weight that belongs to it.
    total = channel_sum(sand(bits))
    valid = a_mask(total.values.shape) if masked else None
    out, contrast = enhance_photograph(total, "bandpass", window, valid)
    assert contrast.crossover is None
    assert contrast.low_pass == pytest.approx(1.0, abs=1e-3)
    weight = contrast.weight
    assert weight == pytest.approx(0.8 * (0.2251 - 0.15) / 0.09)
    passed = gaussian_mean(total.values, 1.0, 3, valid) - weight * gaussian_mean(total.values, 2.0, 6, valid)
    # Of white noise is left the root of 1 / (4 pi s1^2) - 2 w / (2 pi (s1^2 + s2^2)) + w^2 / (4 pi s2^2).
    gain = math.sqrt(1 / (4 * math.pi) - 2 * weight / (10 * math.pi) + weight**2 / (16 * math.pi))
    local = reference(passed, window, math.sqrt(3) * gain, "symmetric", valid)
    # Arctan of half of that: tan(a / 2) goes the way back.
    expected = 127.5 + 127.5 * np.arctan(0.5 * np.tan(local * math.pi / 2)) / (math.pi / 2)
    defined = ~np.isnan(local)
    # A level of 16 bits is held in sixteen parts, and rounded: at the floor of 0.5 that is a few levels in a hundred.
    assert np.abs(out - expected)[defined].max() < 1.0
    assert (out[~defined] == 128).all()
    assert contrast.floor == pytest.approx(math.sqrt(3) * gain, rel=5e-3)


def test_a_band_by_hand():
    # One 1000 among zeros. The first Gaussian's largest weight is (1 / sum of exp(-k^2 / 2), |k| <= 3)^2 = (1 / 2.50596)^2, or
    # 0.159241, the second's (1 / sum of exp(-k^2 / 8), |k| <= 6)^2 = (1 / 5.00812)^2 = 0.039870: 159.241 - 19.935 = 139.306.
    values = np.zeros((41, 41), np.uint16)
    values[20, 20] = 1000
    passed, scale, gain = band_passed(values, 765, Band(1.0, 2.0, 0.5))
    assert passed[20, 20] / scale == pytest.approx(139.306, abs=0.02)
    assert passed.sum() / scale == pytest.approx(500.0, abs=0.1)
    # 1 / (4 pi) - 1 / (10 pi) + 1 / (64 pi) = 0.079577 - 0.031831 + 0.004974 = 0.052720, and its root.
    # Cut at three sigmas, the Gaussians let a little more through.
    assert gain == pytest.approx(0.22961, abs=5e-4)
    flat = band_passed(np.full((20, 20), 765, np.uint16), 765, Band(0.0, 2.0, 0.8))
    assert flat[0] / scale == pytest.approx(np.full((20, 20), 153.0), abs=0.1)


def test_the_band_follows_the_noise():
    # exp(-2 pi^2 s^2 f^2) = 1 / e at f = 0.2251: s = sqrt(1 / 19.7392) / 0.2251 = 0.9999.
    one = band_of(0.2251)
    assert one.fine == pytest.approx(0.9999, abs=1e-4)
    assert band_of(0.4502).fine == pytest.approx(0.5, abs=1e-4)
    second = one.weight * math.exp(-8 * (math.pi * 0.2251) ** 2)
    assert one.response(np.array([0.2251]))[0] == pytest.approx(0.36788 - second, abs=1e-4)
    assert band_of(0.8) == Band(0.0, 2.0, 0.8)  # strong texture is not blurred, and lifted as far as may be
    assert band_of(0.05) == Band(1.5, 2.0, 0.0)  # where there is next to none, nothing is lifted
    assert band_of(0.195).weight == pytest.approx(0.4)  # half way from 0.15 to 0.24
    fine, weights = zip(*((b.fine, b.weight) for b in map(band_of, np.linspace(0.1, 0.8, 30))), strict=True)
    assert (np.diff(fine) <= 0).all()
    assert (np.diff(weights) >= 0).all()


def micmac_reference(values, window, floor, valid=None):
    """What MicMac's formula gives, unrounded, with 65,536 bins from 0 to the largest value."""
    chosen = values[valid] if valid is not None else values.ravel()
    bins = chosen.astype(np.int64) * 65536 // (int(chosen.max()) + 1)
    levels, counts = np.unique(bins, return_counts=True)
    share = {v: (bins <= v).mean() for v in levels}
    roots = {v: np.sqrt(counts[levels <= v]).sum() / np.sqrt(counts).sum() for v in levels}

    def tone(v):
        b = int(v) * 65536 // (int(chosen.max()) + 1)
        return 255 * (share[b] + 2 * v / chosen.max() + 3 * roots[b]) / 6

    tones = np.array([tone(v) if b else np.nan for v, b in zip(values.ravel(), np.isin(values, chosen).ravel(), strict=True)])
    tones = tones.reshape(values.shape)
    margin = np.minimum(64, np.minimum(tones, 255 - tones))
    return tones + margin * reference(values, window, floor, "edge", valid)


@pytest.mark.parametrize("masked", [False, True])
@pytest.mark.parametrize(("bits", "window"), [(8, 5), (12, 11), (16, 25)])
def test_micmac_against_brute_force(bits, window, masked):
    total = channel_sum(sand(bits))
    valid = a_mask(total.values.shape) if masked else None
    expected = micmac_reference(total.values, window, math.sqrt(3), valid)
    out, _ = enhance_photograph(total, "micmac", window, valid)
    defined = ~np.isnan(expected)
    difference = (expected - out)[defined]  # truncated, not rounded
    assert difference.min() > -1e-3
    assert difference.max() < 1 + 1e-3
    assert (out[~defined] == 128).all()


def test_micmac_by_hand():
    # One 9 among twenty-four 0 in a window of 3. Tone of 0: H = 24/25, L = 0, S = sqrt(24) / (sqrt(24) + 1) = 0.8304810, so
    # 255 (0.96 + 2.4914430) / 6 = 146.6863; margin 64. Tone of 9: 255 (1 + 2 + 3) / 6 = 255; margin 0.
    # Beside the 9: mean 1, variance 8, z = -1 / sqrt(8), 2/pi atan z = -0.2163468: 146.6863 - 64 * 0.2163468 = 132.84.
    values = np.zeros((5, 5), np.uint8)
    values[2, 2] = 9
    out, _ = enhance_photograph(grey(values), "micmac", 3)
    assert out[2, 2] == 255
    assert (out[1:4, 1:4].ravel()[[0, 1, 2, 3, 5, 6, 7, 8]] == 132).all()
    assert (out[0] == 146).all()
    assert (out[:, 4] == 146).all()


def test_masked_pixels_enter_nothing():
    # What stands under the mask makes no difference, by any method.
    pixels, valid = sand(12), a_mask((37, 45))
    others = np.where(valid[:, :, None], pixels, np.uint16(4095))
    for method in ("arctan", "micmac", "equalize", "none", "bandpass"):
        results = [enhance_photograph(channel_sum(p), method, 11, valid) for p in (pixels, others)]
        assert (results[0][0] == results[1][0]).all()
        assert results[0][1] == results[1][1]
        assert (results[0][0][~valid] == 128).all()


def test_a_window_by_hand_with_a_mask():
    # A window of 3 in which five pixels are left: 0, 0, 0, 0 and 10 in the middle: mean 2, variance 100/5 - 4 = 16, z = 2.
    # atan(2) = 1.1071487, which is 0.7048328 of a right angle.
    values, valid = np.zeros((3, 3), np.uint8), np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], bool)
    values[1, 1] = 10
    values[~valid] = 200
    out, contrast = enhance_photograph(grey(values), "arctan", 3, valid)
    assert out[1, 1] == math.floor(127.5 + 127.5 * 0.7048328 + 0.5) == 217
    assert (out[~valid] == 128).all()
    assert contrast.masked_percent == pytest.approx(100 * 4 / 9)


def test_a_quarter_of_the_window_must_be_left():
    valid = np.zeros((9, 9), bool)
    valid[4, 4] = True
    assert not usable(valid, "arctan", 3).any()  # 1 of 9 is left
    valid[4, 5] = valid[5, 4] = True
    assert usable(valid, "arctan", 3).sum() == 3  # 3 of 9 in all three windows
    assert (usable(valid, "none", 3) == valid).all()


def test_all_masked():
    for method in ("arctan", "micmac", "equalize", "none", "bandpass"):
        out, contrast = enhance_photograph(channel_sum(sand(8)), method, 11, np.zeros((37, 45), bool))
        assert (out == 128).all()
        assert (contrast.masked_percent, contrast.noise, contrast.mean_sigma) == (100.0, 0.0, None)


def test_equalize_counts_unmasked_pixels_only():
    values, valid = np.array([[0, 0, 3], [3, 3, 7]], np.uint8), np.array([[1, 0, 1], [1, 0, 1]], bool)
    out, _ = enhance_photograph(grey(values), "equalize", 3, valid)
    assert out.tolist() == [[64, 128, 191], [191, 128, 255]]  # 255 times 1/4, 3/4, 1, rounded


def test_the_noise_floor_follows_the_step():
    # 12 bits spread over 16: one DN of the file is 16 in the values, and so is the floor.
    pixels = sand(12)
    coarse = replace(channel_sum(pixels * 16), step=16.0)
    first, told = enhance_photograph(channel_sum(pixels), "arctan", 11)
    second, spread = enhance_photograph(coarse, "arctan", 11)
    assert (first == second).all()
    assert spread.noise == pytest.approx(told.noise)
    assert spread.mean_sigma == pytest.approx(told.mean_sigma)
    assert spread.floor == told.floor == pytest.approx(math.sqrt(3))
    assert (told.levels, spread.levels) == (65535.0, 65535.0 / 16)


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
