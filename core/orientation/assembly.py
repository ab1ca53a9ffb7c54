"""From a sparse model to the arrays that the adjustment works on, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import cv2  # noqa: F401 - before pycolmap, whose PNG library otherwise crashes OpenCV's
import numpy as np
import pycolmap
from numpy.typing import NDArray

from ..block import Block, View
from ..camera import PARAMETERS, Camera
from . import bundle
from .cameras import Cameras, Rays
from .evenness import even_choice
from .interior import Interior, merged
from .network import Network
from .similarity import Similarity

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Assembly:
    """A block with the rays of its points (all of them, in its order) and the camera ids of its views (n,)."""

    block: Block
    rays: Rays
    camera_ids: tuple[int, ...]

    @property
    def sizes(self) -> NDArray[np.int64]:
        """Width and height (n, 2) of the views."""
        return np.array([(v.camera.width, v.camera.height) for v in self.block.views], np.int64)

    def cameras_by_id(self) -> dict[int, Camera]:
        """Return the cameras."""
        return {key: view.camera for key, view in zip(self.camera_ids, self.block.views, strict=True)}


def assemble(model: pycolmap.Reconstruction, block: Block) -> Assembly:
    """Return the rays of ``block``, which is that of ``model``."""
    index_of = {view.name: i for i, view in enumerate(block.views)}
    number_of = {key: n for n, key in enumerate(sorted(model.points3D))}
    points, views, pixels = [], [], []
    camera_ids = [0] * len(block.views)
    for image_id in sorted(model.reg_image_ids()):
        image = model.images[image_id]
        view = index_of[image.name]
        camera_ids[view] = image.camera_id
        seen = [image.points2D[i] for i in image.get_observation_point2D_idxs()]
        points.append(np.array([number_of[p.point3D_id] for p in seen], np.int64))
        views.append(np.full(len(seen), view))
        pixels.append(np.array([p.xy for p in seen], float).reshape(-1, 2))
    point, view_of, xy = np.concatenate(points), np.concatenate(views), np.concatenate(pixels)
    order = np.lexsort((view_of, point))
    start = np.concatenate([[0], np.cumsum(np.bincount(point, minlength=len(number_of)))])
    return Assembly(block, Rays(start.astype(np.int64), view_of[order].astype(np.int64), xy[order]), tuple(camera_ids))


def network_of(
    assembly: Assembly, similarity: Similarity, interiors: Mapping[int, Interior], usable: NDArray[np.bool_]
) -> Network:
    """Return the network of an even choice of the ``usable`` points (p,), after the similarity; interiors are by camera id."""
    block, keys = assembly.block, sorted(interiors)
    by_id = assembly.cameras_by_id()
    basis, free = merged(interiors)
    cameras = Cameras(
        np.array([v.rotation @ similarity.rotation.T for v in block.views]),
        similarity.apply(np.array([v.centre for v in block.views])),
        np.array([keys.index(i) for i in assembly.camera_ids], np.int64),
        np.array([by_id[key].brown() for key in keys]),
        basis,
        free,
    )
    taken = np.flatnonzero(usable)
    chosen = taken[even_choice(assembly.rays.only(usable), block.errors[usable], assembly.sizes)]
    mask = np.zeros(len(usable), bool)
    mask[chosen] = True
    return Network(cameras, tuple(interiors[k] for k in keys), assembly.rays.only(mask), similarity.apply(block.points[mask]))


def adjusted_block(
    assembly: Assembly, similarity: Similarity, cameras: Cameras, usable: NDArray[np.bool_]
) -> tuple[Block, NDArray[np.bool_]]:
    """Return the block in the local frame, and which of the points it has (p,).

    It has the ``usable`` ones where their rays now meet, but those whose rays do not meet in front of the cameras any more.
    """
    block, rays = assembly.block, assembly.rays
    views = tuple(
        View(view.name, _camera(view.camera, cameras.brown[c]), turn, -turn @ centre)
        for view, c, turn, centre in zip(block.views, cameras.camera, cameras.rotation, cameras.centre, strict=True)
    )
    points, residuals = bundle.intersect(rays.arrays, np.ones(len(rays.view)), similarity.apply(block.points), cameras.arrays, 4)
    length = np.hypot(*residuals.T)
    counts = np.diff(rays.start)
    mean = np.add.reduceat(length, rays.start[:-1]) / np.maximum(counts, 1) if len(length) else np.zeros(0)
    kept = usable & np.isfinite(mean) & (counts > 0)
    number = np.cumsum(kept) - 1
    seen = kept[block.observed_point]
    observed = number[block.observed_point[seen]].astype(np.int32)
    return Block(views, points[kept], mean[kept], block.rays[kept], observed, block.observed_view[seen]), kept


def write_back(model: pycolmap.Reconstruction, block: Block, kept: NDArray[np.bool_]) -> None:
    """Give ``model`` the poses, cameras and points of a block of the same photographs; points not ``kept`` (p,) are removed."""
    ids = sorted(model.points3D)
    by_name = {view.name: view for view in block.views}
    for key, stays in zip(ids, kept.tolist(), strict=True):
        if not stays:
            model.delete_point3D(key)
    for key, place in zip([k for k, stays in zip(ids, kept.tolist(), strict=True) if stays], block.points, strict=True):
        model.points3D[key].xyz = place
    for image_id in sorted(model.reg_image_ids()):
        image = model.images[image_id]
        view = by_name[image.name]
        image.frame.rig_from_world = pycolmap.Rigid3d(pycolmap.Rotation3d(view.rotation), view.translation)
        model.cameras[image.camera_id].params = list(view.camera.params)
    model.update_point_3d_errors()


def _camera(camera: Camera, brown: Array) -> Camera:
    values = dict(zip(PARAMETERS["FULL_OPENCV"], brown.tolist(), strict=True))
    values["f"] = values["fx"]
    return replace(camera, params=tuple(values[name] for name in PARAMETERS[camera.model]))
