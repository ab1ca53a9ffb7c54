"""Tracks, least-squares matching, and the refinement of tracks: by hand, and on pictures known at every point."""

import cv2
import numpy as np
import pytest
from strandline.core.progress import SILENT
from strandline.core.survey import Photograph
from strandline.core.tiepoints.features import Features, write_features
from strandline.core.tiepoints.images import SearchedImage
from strandline.core.tiepoints.leastsquares import SIDE, cut_patches, holds_patch, match_patches
from strandline.core.tiepoints.refinement import Source, affinities, choose_references, read_refined, refine_keypoints
from strandline.core.tiepoints.tracks import build_tracks, within_tracks

WAVES = np.random.default_rng(3).normal(0.0, 0.25, (60, 2))  # radians per pixel: wavelengths of 10 pixels and more
PHASES = np.random.default_rng(4).uniform(0, 2 * np.pi, 60)


def ground(xy):
    """Return grey levels of a ground that is known at every point (n, 2), mean 128, sigma 25."""
    return 128 + 25 * np.sqrt(2 / 60) * np.cos(xy @ WAVES.T + PHASES).sum(axis=-1)


def picture(size, matrix, offset, gain=1.0, noise=0.0, seed=0):
    """Return 8-bit pixels of the ground; ``matrix`` and ``offset`` lead from pixels to the ground."""
    y, x = np.mgrid[: size[1], : size[0]] + 0.5
    grey = ground(np.stack([x, y], axis=-1) @ np.asarray(matrix).T + offset)
    grey = 128 + gain * (grey - 128) + np.random.default_rng(seed).normal(0, noise, grey.shape) if noise or gain != 1 else grey
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def matches(*rows):
    return np.array(rows, np.int32).reshape(-1, 2)


def likeness(*values):
    return np.array(values, np.float32)


def test_a_track_has_one_keypoint_in_each_photograph():
    # 0:0 - 1:0 - 2:0 and, less alike, 0:0 - 2:1: that would put two keypoints of photograph 2 into one track.
    found = {(0, 1): matches([0, 0]), (0, 2): matches([0, 1], [1, 2]), (1, 2): matches([0, 0])}
    alike = {(0, 1): likeness(0.99), (0, 2): likeness(0.9, 0.95), (1, 2): likeness(0.98)}
    tracks = build_tracks(found, alike, [2, 1, 4])
    assert [t.tolist() for t in tracks] == [[0, 1], [0], [0, -1, 1, -1]]
    assert within_tracks(found[0, 2], tracks[0], tracks[2]).tolist() == [False, True]
    # The other way round the other match is the wrong one.
    alike[0, 2], alike[1, 2] = likeness(0.99, 0.95), likeness(0.9)
    assert [t.tolist() for t in build_tracks(found, alike, [2, 1, 4])] == [[0, 1], [0], [-1, 0, 1, -1]]
    assert [t.tolist() for t in build_tracks({}, {}, [2, 0])] == [[-1, -1], []]


def test_long_tracks_join_through_chains():
    count = 50
    found = {(i, i + 1): matches([0, 0]) for i in range(count - 1)}
    alike = {pair: likeness(0.5 + 0.01 * (k * 7 % 50)) for k, pair in enumerate(found)}
    assert {int(t[0]) for t in build_tracks(found, alike, [1] * count)} == {0}


def test_patches_are_cut_whole_or_not_at_all():
    image = np.arange(60 * 50, dtype=np.uint32).reshape(50, 60).astype(np.uint8)
    half = SIDE // 2
    xy = np.array([[half, half], [half - 0.01, half], [60 - half - 0.01, 50 - half - 0.01], [60 - half, 20]], np.float32)
    assert holds_patch(xy, (60, 50)).tolist() == [True, False, True, False]
    patches = cut_patches(image, xy)
    assert np.array_equal(patches[0], image[:SIDE, :SIDE])
    assert np.array_equal(patches[2], image[-SIDE:, -SIDE:])
    assert not patches[1].any()


@pytest.mark.parametrize("gain", [1.0, 0.6])
def test_a_patch_is_found_to_some_hundredths_of_a_pixel(gain):
    # Two pictures of one ground, the second turned by 8 degrees, zoomed by 1.1 and shifted, of another contrast.
    turn = 1.1 * np.array([[np.cos(0.14), -np.sin(0.14)], [np.sin(0.14), np.cos(0.14)]])
    first = picture((300, 300), np.eye(2), np.zeros(2))
    second = picture((400, 400), np.linalg.inv(turn), [30.3, -20.7], gain, noise=1.0)
    rng = np.random.default_rng(1)
    xy = rng.uniform(120, 220, (200, 2))
    truth = (xy - [30.3, -20.7]) @ turn.T
    start = truth + rng.uniform(-1, 1, truth.shape)
    place, correlation = match_patches(second, cut_patches(first, xy), xy, np.tile(turn, (200, 1, 1)), start)
    error = np.hypot(*(place - truth).T)
    # What 8 bits, noise of one level and interpolation between pixels leave.
    assert np.sqrt(np.mean(error**2)) < 0.02 / gain
    assert error.max() < 0.1
    assert correlation.min() > 0.97


def test_what_cannot_be_matched_is_nan():
    image = picture((120, 120), np.eye(2), np.zeros(2))
    stripes = np.tile(np.arange(120) % 16 * 10, (120, 1)).astype(np.uint8)
    same = np.eye(2)[None]

    def place(first, second, start):
        return match_patches(second, cut_patches(first, np.array([[60.2, 60.7]])), np.array([[60.2, 60.7]]), same, [start])[0]

    assert np.abs(place(image, image, [61.0, 60.0]) - [60.2, 60.7]).max() < 0.02
    assert np.isnan(place(image, image, [5.0, 60.0])).all()  # over the edge
    assert np.isnan(place(np.full_like(image, 9), image, [60.0, 60.0])).all()  # flat
    assert np.isnan(place(stripes, stripes, [60.0, 60.0])).all()  # held in one direction only
    assert np.isnan(place(image, np.full_like(image, 9), [60.0, 60.0])).all()


def test_affinities_follow_the_plane_or_the_keypoints():
    first = np.array([[10, 10, 2.0, 0.0]], np.float32)
    second = np.array([[50, 20, 3.0, np.pi / 2]], np.float32)
    # Alone: zoomed by 1.5 and turned by a quarter, x towards y.
    assert affinities(first, second, 1000) == pytest.approx(np.array([[[0.0, -1.5], [1.5, 0.0]]]), abs=1e-6)
    plane = np.array([[1.1, 0.1, 5], [-0.05, 0.9, 7], [1e-4, -5e-5, 1]])
    rng = np.random.default_rng(5)
    xy = rng.uniform(100, 900, (30, 2))
    mapped = cv2.perspectiveTransform(xy[None], plane)[0]
    keypoints = [np.column_stack([p, np.full(30, 2.0), np.zeros(30)]) for p in (xy, mapped)]
    step = 1e-3 * np.eye(2)
    ahead = np.stack([cv2.perspectiveTransform((xy + s)[None], plane)[0] - mapped for s in step], axis=-1) / 1e-3
    assert np.abs(affinities(*keypoints, 1000) - ahead).max() < 1e-4


@pytest.fixture
def block(tmp_path):
    """Three pictures of one ground shifted against each other, and keypoints detected with an error of half a pixel."""
    offsets = np.array([[0.0, 0.0], [40.4, 12.3], [-20.7, 31.1]])
    rng = np.random.default_rng(7)
    grid = np.stack(np.meshgrid(np.arange(80, 320, 20.0), np.arange(80, 220, 20.0)), axis=-1).reshape(-1, 2)
    sources, truth = [], []
    for i, offset in enumerate(offsets):
        path = tmp_path / f"{i}.png"
        assert cv2.imwrite(str(path), picture((400, 300), np.eye(2), offset, noise=1.0, seed=i))
        true = grid - offset
        seen = (true + rng.normal(0, 0.35, true.shape)).astype(np.float32)
        if i == 2:
            seen[5] += 9.0  # a wrong match
        same = np.full(len(grid), 2.0, np.float32)
        write_features(tmp_path / f"f{i}.npz", Features(seen, same, 0 * same, np.zeros((len(grid), 128), np.uint8)))
        photograph = Photograph(f"{i}.png", 1, "", 400, 300, "camera")
        sources.append(Source(SearchedImage(photograph, path, True, None, 0), tmp_path / f"f{i}.npz"))
        truth.append(true)
    every = np.column_stack([np.arange(len(grid))] * 2).astype(np.int32)
    found = {(0, 1): every, (0, 2): every, (1, 2): every}
    tracks = build_tracks(found, {pair: np.ones(len(every), np.float32) for pair in found}, [len(grid)] * 3)
    return sources, truth, tracks, found


def test_the_reference_is_the_best_tied_and_most_central(block):
    sources, _, tracks, found = block
    chosen = choose_references(sources, tracks, found)
    # Tied alike: the place nearest to the middle of its photograph, x and y as shares of the sides.
    places = np.stack([read_refined_xy(s) for s in sources])
    off = np.linalg.norm(places / [400, 300] - 0.5, axis=2)
    assert chosen.photograph.tolist() == off.argmin(axis=0).tolist()
    assert chosen.keypoint.tolist() == list(range(len(off[0])))
    for i in range(3):
        assert chosen.row[chosen.photograph == i].tolist() == list(range((chosen.photograph == i).sum()))
    # Without its matches to 0, no keypoint of 0 is a reference.
    alone = {(0, 1): found[0, 1][:1], (1, 2): found[1, 2]}
    assert not (choose_references(sources, tracks, alone).photograph == 0).any()


def read_refined_xy(source):
    return np.load(source.features)["xy"].astype(float)


def test_tracks_are_refined_and_what_is_wrong_leaves(block, tmp_path):
    sources, truth, tracks, found = block
    calls = []

    def run(function, given, total, progress):
        given = list(given)
        assert len(given) == total
        calls.append(total)
        for call in reversed(given) if len(calls) > 4 else given:
            function(*call)

    files = refine_keypoints(sources, tracks, found, folder=tmp_path / "cache", run=run, progress=SILENT)
    assert calls == [3, 3]
    places, tied = zip(*(read_refined(s, f) for s, f in zip(sources, files, strict=True)), strict=True)
    assert np.flatnonzero(~tied[2]).tolist() == [5]
    assert tied[0].all()
    assert tied[1].all()
    # Each track's own shift is that of its reference's detection; against each other its keypoints agree.
    errors = np.stack([p[:, :2] - t for p, t in zip(places, truth, strict=True)])
    errors = errors[:, tied[2]] - errors[:, tied[2]].mean(axis=0)
    assert np.sqrt(np.mean(errors**2)) < 0.02  # as above; 0.3 before
    # What stands is kept; in another order, elsewhere, the same comes out.
    assert refine_keypoints(sources, tracks, found, folder=tmp_path / "cache", run=run, progress=SILENT) == files
    assert calls == [3, 3, 0, 0]
    again = refine_keypoints(sources, tracks, found, folder=tmp_path / "other", run=run, progress=SILENT)
    assert [f.name for f in again] == [f.name for f in files]
    for source, a, b in zip(sources, files, again, strict=True):
        assert np.array_equal(read_refined(source, a)[0], read_refined(source, b)[0])


def test_a_reduced_image_is_refined_in_the_photographs_pixels(block, tmp_path):
    sources, truth, tracks, found = block
    small = [Source(SearchedImage(s.image.photograph, s.image.path, True, None, 301), s.features) for s in sources]
    assert small[0].image.working_size == (301, 226)

    def run(function, given, total, progress):
        for call in given:
            function(*call)

    files = refine_keypoints(small, tracks, found, folder=tmp_path / "cache", run=run, progress=SILENT)
    places, tied = zip(*(read_refined(s, f) for s, f in zip(small, files, strict=True)), strict=True)
    every = np.logical_and.reduce(tied)
    assert every.sum() > 0.9 * len(every)
    errors = np.stack([p[every, :2] - t[every] for p, t in zip(places, truth, strict=True)])
    assert np.sqrt(np.mean((errors - errors.mean(axis=0)) ** 2)) < 0.04
