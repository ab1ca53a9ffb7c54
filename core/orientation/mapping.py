"""From matches to a first sparse model: COLMAP's mappers on thinned matches, then the tie points of all matches.

All of it runs on one thread: on several, COLMAP adds up in the order in which threads finish, and two runs differ. On one
they are the same to the bit, and thinning the matches saves more time than threads would.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import cv2  # noqa: F401 - before pycolmap, whose PNG library otherwise crashes OpenCV's
import numpy as np
import pycolmap
from numpy.typing import NDArray

from ..camera import Camera
from ..errors import NotEnoughData
from ..progress import Progress
from ..tiepoints.thinning import thinned
from .merging import join

SEED = 1
_THIN = 1000  # observations or more that each photograph keeps for the mapping
_LEAST = 12  # points from which a photograph's pose is accepted: what a small common corner gives
_ERROR = 6.0 / 2000.0  # of the longer side: what a point may be off while the distortion is not known
_ANGLE = 1.5  # degrees: rays that meet at less tell no depth
_NARROW = 3.0  # degrees between the rays of a first pair, when no pair has more
_GROWTH = 1.3  # photographs or points between two adjustments of the whole block


@dataclass(frozen=True)
class Network:
    """What a database holds: names, cameras and features' places (n, 2) by image id, verified matches (m, 2) by pair of them."""

    names: dict[int, str]
    camera_of: dict[int, int]
    cameras: dict[int, Camera]
    xy: dict[int, NDArray[np.float32]]
    matches: dict[tuple[int, int], NDArray[np.int32]]


def read_network(path: Path) -> Network:
    """Return what the database at ``path`` holds."""
    database = pycolmap.Database.open(path)
    try:
        images = sorted(database.read_all_images(), key=lambda image: image.image_id)
        pair_ids, geometries = database.read_two_view_geometries()
        matches = {}
        for pair, geometry in zip(pair_ids, geometries, strict=True):
            i, j = pycolmap.pair_id_to_image_pair(pair)
            matches[i, j] = np.asarray(geometry.inlier_matches, np.int32).reshape(-1, 2)
        return Network(
            {image.image_id: image.name for image in images},
            {image.image_id: image.camera_id for image in images},
            {c.camera_id: camera_from_colmap(c) for c in database.read_all_cameras()},
            {image.image_id: np.asarray(database.read_keypoints(image.image_id))[:, :2] for image in images},
            matches,
        )
    finally:
        database.close()


def camera_from_colmap(camera: pycolmap.Camera) -> Camera:
    """Return a COLMAP camera as a plain one."""
    return Camera(camera.model.name, camera.width, camera.height, tuple(float(p) for p in camera.params))


def map_photographs(
    database: Path,
    network: Network,
    *,
    mapper: Literal["incremental", "global"],
    given: Mapping[int, Camera],
    progress: Progress,
) -> list[pycolmap.Reconstruction]:
    """Return sparse models of thinned matches, the one of most photographs first.

    Cameras (by camera id) in ``given`` are held; the others start from the database's and adjust focal length and one radial
    term, which is as much as a growing block determines safely.
    """
    with tempfile.TemporaryDirectory(prefix="strandline-") as folder:
        copy = Path(folder) / "thinned.db"
        shutil.copyfile(database, copy)
        _thin(copy, network, given)
        # COLMAP wants a folder of images only to colour points, which is not asked for.
        if mapper == "global":
            return _joined(copy, pycolmap.global_mapping(copy, folder, folder, _global_options(given)))
        options = _incremental_options(network, given)
        registered = 0

        def count() -> None:
            nonlocal registered
            registered += 1
            progress.at(min(1.0, registered / len(network.names)))

        progress.at(0.0)
        with quiet():
            models = pycolmap.incremental_mapping(copy, folder, folder, options, next_image_callback=count)
            if not models:  # a pair alone, or photographs that are all close together
                options.mapper.init_min_tri_angle = _NARROW
                options.mapper.init_min_num_inliers = 25
                models = pycolmap.incremental_mapping(copy, folder, folder, options, next_image_callback=count)
        return _joined(copy, models)


def triangulate(database: Path, model: pycolmap.Reconstruction) -> pycolmap.Reconstruction:
    """Return ``model`` with the tie points of all matches in the database, two-ray points included; poses are held."""
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads, options.random_seed, options.extract_colors = 1, SEED, False
    options.ba_refine_focal_length = options.ba_refine_extra_params = False
    options.triangulation.ignore_two_view_tracks = False
    options.triangulation.random_seed = SEED
    options.mapper.filter_min_tri_angle = _ANGLE
    with tempfile.TemporaryDirectory(prefix="strandline-") as folder, quiet():
        copy = Path(folder) / "features.db"
        shutil.copyfile(database, copy)
        _update_cameras(copy, {key: camera_from_colmap(camera) for key, camera in model.cameras.items()})
        return pycolmap.triangulate_points(model, copy, folder, folder, clear_points=True, options=options)


@contextmanager
def quiet() -> Iterator[None]:
    """Keep COLMAP's log to what ends it; what it calls errors is told here in one sentence."""
    silent = pycolmap.logging.Level.FATAL.value
    pycolmap.logging.minloglevel = silent
    try:
        yield
    finally:
        pycolmap.logging.minloglevel = silent  # some of its functions reset the level when they end


def _thin(path: Path, network: Network, given: Mapping[int, Camera]) -> None:
    ids = list(network.names)
    index = {image: i for i, image in enumerate(ids)}
    sizes = [(c.width, c.height) for c in (network.cameras[network.camera_of[i]] for i in ids)]
    pairs = {(index[i], index[j]): m for (i, j), m in network.matches.items()}
    kept = thinned(pairs, [network.xy[i] for i in ids], sizes, _THIN)
    database = pycolmap.Database.open(path)
    try:
        with pycolmap.DatabaseTransaction(database):
            for i, j in network.matches:
                geometry = database.read_two_view_geometry(i, j)
                matches = kept.get((index[i], index[j]), np.zeros((0, 2), np.int32))
                geometry.inlier_matches = matches.astype(np.uint32)
                database.update_two_view_geometry(i, j, geometry)
    finally:
        database.close()
    _update_cameras(path, given)


def _update_cameras(path: Path, cameras: Mapping[int, Camera]) -> None:
    database = pycolmap.Database.open(path)
    try:
        for camera_id, camera in cameras.items():
            known = pycolmap.Camera(
                model=camera.model, width=camera.width, height=camera.height, params=list(camera.params), camera_id=camera_id
            )
            known.has_prior_focal_length = True
            database.update_camera(known)
    finally:
        database.close()


def _incremental_options(network: Network, given: Mapping[int, Camera]) -> pycolmap.IncrementalPipelineOptions:
    error = _ERROR * max(max(c.width, c.height) for c in network.cameras.values())
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads, options.random_seed, options.extract_colors = 1, SEED, False
    options.min_model_size = 2
    options.max_model_overlap = 6  # what a second model has in common with the first serves to join them
    options.min_num_matches = 10
    options.ba_global_frames_ratio = options.ba_global_points_ratio = _GROWTH
    options.ba_global_max_refinements = 2
    options.constant_cameras = set(given)
    options.mapper.constant_cameras = set(given)
    options.mapper.abs_pose_min_num_inliers = _LEAST
    options.mapper.abs_pose_min_inlier_ratio = 0.1
    options.mapper.abs_pose_max_error = max(12.0, error)
    options.mapper.max_reg_trials = 5
    options.mapper.init_min_num_inliers = 50
    options.mapper.filter_min_tri_angle = _ANGLE
    options.mapper.num_threads, options.mapper.random_seed = 1, SEED
    options.triangulation.random_seed = SEED
    # Where two photographs alone join two parts of a block, their points of two rays hold the pose of the one behind.
    options.triangulation.ignore_two_view_tracks = False
    # A photograph that sees too few points of the model is joined by its matches with several photographs of it, if it can be;
    # the final adjustment takes out what three rays do not hold.
    options.structure_less_registration_fallback = True
    return options


def _global_options(given: Mapping[int, Camera]) -> pycolmap.GlobalPipelineOptions:
    options = pycolmap.GlobalPipelineOptions()
    options.num_threads, options.random_seed, options.min_model_size = 1, SEED, 2
    options.mapper.num_threads, options.mapper.random_seed = 1, SEED
    options.mapper.bundle_adjustment.ceres.use_gpu = options.mapper.global_positioning.use_gpu = False
    options.mapper.bundle_adjustment.refine_focal_length = options.mapper.bundle_adjustment.refine_extra_params = not given
    return options


def _joined(database: Path, models: Mapping[int, pycolmap.Reconstruction]) -> list[pycolmap.Reconstruction]:
    """Return the block that the models make together, then those that do not belong to it, the largest first."""
    ranked = sorted(models.values(), key=lambda m: (-m.num_reg_images(), -m.num_points3D()))
    if not ranked or ranked[0].num_reg_images() < 2:
        raise NotEnoughData(
            "No two photographs could be oriented to each other: look for weakly tied photographs in the report of "
            "strandline:tiepoints, and check that they were taken from different places."
        )
    block, rest, joined = join(ranked)
    return [triangulate(database, block) if joined else block, *rest]
