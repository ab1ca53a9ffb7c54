"""The final bundle adjustment: interior orientation, poses and tie points together, and its filter.

The principal point is adjusted with Brown's and the full model when ten or more photographs share the camera, else held in the
middle: in fewer, and in one strip, it cannot be told from a tilt.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import cv2  # noqa: F401 - before pycolmap, whose PNG library otherwise crashes OpenCV's
import numpy as np
import pycolmap
from numpy.typing import NDArray

from ..camera import PARAMETERS, Camera
from .focal import FocalPrior, add_priors
from .mapping import camera_from_colmap, quiet

Array = NDArray[np.float64]

MODELS = {"simple_radial": "SIMPLE_RADIAL", "radial": "RADIAL", "brown": "OPENCV", "full": "FULL_OPENCV"}
_PRINCIPAL_POINT_FROM = 10  # photographs of one camera
FILTER = 6.0  # robust sigmas of a 2D residual beyond which an observation is dropped
_COARSE_FILTER = 8.0
_RAYLEIGH = 1.17741  # the median of a 2D residual in units of its sigma per axis
_ANGLE = 1.5  # degrees, the least at which two rays of a point meet
NO_PRIORS: Mapping[int, FocalPrior] = MappingProxyType({})


@dataclass(frozen=True)
class Observations:
    """Observations (n,) of a model: image id, index of the keypoint, point id, and the residual's x and y (n, 2) in pixels."""

    image: NDArray[np.int64]
    keypoint: NDArray[np.int64]
    point: NDArray[np.int64]
    residual: Array

    @property
    def length(self) -> Array:
        """The length of the residual (n,), infinite where the point cannot be seen."""
        length = np.hypot(self.residual[:, 0], self.residual[:, 1])
        return np.where(np.isfinite(length), length, np.inf)


def convert_camera(camera: Camera, model: str) -> Camera:
    """Return ``camera`` with another of COLMAP's models; terms that the model lacks are dropped."""
    values = dict(zip(PARAMETERS["FULL_OPENCV"], camera.brown().tolist(), strict=True))
    values["f"] = (values["fx"] + values["fy"]) / 2
    values["k"] = values["k1"]
    return Camera(model, camera.width, camera.height, tuple(values[name] for name in PARAMETERS[model]))


def set_camera(model: pycolmap.Reconstruction, camera_id: int, camera: Camera) -> None:
    """Give a camera of ``model`` another model and parameters."""
    target = model.cameras[camera_id]
    target.model = getattr(pycolmap.CameraModelId, camera.model)
    target.params = list(camera.params)


def observations(model: pycolmap.Reconstruction) -> Observations:
    """Return the observations of a model with their residuals (observed minus projected)."""
    images, keypoints, points, residuals = [], [], [], []
    for image_id in sorted(model.reg_image_ids()):
        image = model.images[image_id]
        index = np.asarray(image.get_observation_point2D_idxs(), np.int64)
        if not len(index):
            continue
        seen = [image.points2D[i] for i in index.tolist()]
        ids = np.array([p.point3D_id for p in seen], np.int64)
        world = np.array([model.points3D[i].xyz for i in ids.tolist()])
        pose = image.cam_from_world()
        inside = world @ np.asarray(pose.rotation.matrix()).T + np.asarray(pose.translation)
        projected = camera_from_colmap(image.camera).project(inside)
        images.append(np.full(len(index), image_id))
        keypoints.append(index)
        points.append(ids)
        residuals.append(np.array([p.xy for p in seen]) - projected)
    if not images:
        none = np.zeros(0, np.int64)
        return Observations(none, none, none, np.zeros((0, 2)))
    return Observations(np.concatenate(images), np.concatenate(keypoints), np.concatenate(points), np.concatenate(residuals))


def indexed(found: Observations, image_ids: Sequence[int]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the photograph (index in ``image_ids``) and the track, numbered from 0, of each observation (n,)."""
    order = np.argsort(image_ids)
    photograph = order[np.searchsorted(np.asarray(image_ids)[order], found.image)]
    return photograph, np.unique(found.point, return_inverse=True)[1]


def among(found: Observations, others: Observations) -> NDArray[np.bool_]:
    """Tell which observations (n,) are also among ``others``."""
    mine, theirs = ((o.image << 32) + o.keypoint for o in (found, others))
    return np.isin(mine, theirs)


def robust_sigma(length: Array) -> float:
    """Return the sigma per axis (px) of 2D residuals from the median of their lengths."""
    return float(np.median(length) / _RAYLEIGH)


def adjust(
    model: pycolmap.Reconstruction,
    camera_model: Literal["brown", "radial", "simple_radial", "full"],
    fixed: Collection[int] = (),
    *,
    robust: float,
    iterations: int,
    priors: Mapping[int, FocalPrior] = NO_PRIORS,
) -> None:
    """Adjust all of ``model`` in place; cameras whose id is in ``fixed`` keep their parameters.

    ``robust`` is the length of a residual (px) beyond which it weighs less (soft L1); ``priors`` are by camera id.
    """
    adjuster = make_adjuster(model, camera_model, fixed, robust=robust, iterations=iterations)
    with quiet():
        alive = add_priors(adjuster, model, priors, fixed, sigma=robust_sigma(observations(model).length))
        adjuster.solve()
        del alive
    model.update_point_3d_errors()


def make_adjuster(
    model: pycolmap.Reconstruction,
    camera_model: Literal["brown", "radial", "simple_radial", "full"],
    fixed: Collection[int],
    *,
    robust: float,
    iterations: int,
) -> pycolmap.CeresBundleAdjuster:
    """Return the adjuster of ``adjust``, not yet solved."""
    config = pycolmap.BundleAdjustmentConfig()
    per_camera: dict[int, int] = {}
    for image_id in sorted(model.reg_image_ids()):
        config.add_image(image_id)
        camera_id = model.images[image_id].camera_id
        per_camera[camera_id] = per_camera.get(camera_id, 0) + 1
    for camera_id in fixed:
        config.set_constant_cam_intrinsics(camera_id)
    config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    options = pycolmap.BundleAdjustmentOptions()
    options.print_summary = False
    options.refine_principal_point = principal_point_is_adjusted(per_camera, camera_model, fixed)
    options.ceres.loss_function_type = pycolmap.LossFunctionType.SOFT_L1
    options.ceres.loss_function_scale = robust
    solver = options.ceres.solver_options
    solver.num_threads, solver.max_num_iterations, solver.function_tolerance = 1, iterations, 1e-8
    return pycolmap.create_default_ceres_bundle_adjuster(options, config, model)


def principal_point_is_adjusted(per_camera: dict[int, int], camera_model: str, fixed: Collection[int]) -> bool:
    """Tell whether the principal point is adjusted, from the number of photographs per camera id."""
    free = [n for camera_id, n in per_camera.items() if camera_id not in fixed]
    return camera_model in ("brown", "full") and bool(free) and min(free) >= _PRINCIPAL_POINT_FROM


def drop_observations(model: pycolmap.Reconstruction, found: Observations, limit: float) -> None:
    """Remove observations longer than ``limit`` (px), and points whose rays hardly cross."""
    manager = pycolmap.ObservationManager(model)
    for i in np.flatnonzero(found.length > limit).tolist():
        image_id, keypoint = int(found.image[i]), int(found.keypoint[i])
        if model.images[image_id].points2D[keypoint].has_point3D():
            manager.delete_observation(image_id, keypoint)
    manager.filter_points3D_with_small_triangulation_angle(_ANGLE, set(model.point3D_ids()))


def self_calibrate(
    model: pycolmap.Reconstruction,
    camera_model: Literal["brown", "radial", "simple_radial", "full"],
    fixed: Collection[int],
    *,
    rounds: int,
    iterations: int,
    priors: Mapping[int, FocalPrior] = NO_PRIORS,
) -> None:
    """Adjust ``model`` in place and drop what is far off, ``rounds`` times."""
    for _ in range(rounds):
        sigma = robust_sigma(observations(model).length)
        adjust(model, camera_model, fixed, robust=max(2 * sigma, 0.1), iterations=iterations, priors=priors)
        found = observations(model)
        drop_observations(model, found, _COARSE_FILTER * robust_sigma(found.length))


def camera_sigmas(
    model: pycolmap.Reconstruction,
    camera_model: Literal["brown", "radial", "simple_radial", "full"],
    fixed: Collection[int],
    priors: Mapping[int, FocalPrior] = NO_PRIORS,
) -> dict[int, Array]:
    """Return the sigma of each parameter of each adjusted camera of an adjusted model, by camera id; 0 where it was held.

    It is formal: residuals are taken as independent with their robust sigma.
    """
    sigma = robust_sigma(observations(model).length)
    adjuster = make_adjuster(model, camera_model, fixed, robust=1e6, iterations=1)
    with quiet():
        alive = add_priors(adjuster, model, priors, fixed, sigma=sigma)
        adjuster.solve()
        options = pycolmap.BACovarianceOptions()
        options.params = pycolmap.BACovarianceOptionsParams.ALL
        covariance = pycolmap.estimate_ba_covariance(options, model, adjuster)
        del alive
    if covariance is None:  # the block is too weak to tell
        return {}
    held: dict[int, list[int]] = {camera_id: [] for camera_id in model.cameras}
    for camera_id, camera in model.cameras.items():
        if not adjuster.options.refine_principal_point:
            held[camera_id] = list(camera.principal_point_idxs())
    result = {}
    for camera_id, camera in model.cameras.items():
        matrix = None if camera_id in fixed else covariance.get_other_params_cov(camera.params)
        if matrix is None:
            continue
        values = np.zeros(len(camera.params))
        free = [i for i in range(len(values)) if i not in held[camera_id]]
        values[free] = sigma * np.sqrt(np.diag(matrix))
        result[camera_id] = values
    return result
