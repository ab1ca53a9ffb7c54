"""Sparse models that share photographs, joined into one.

A block that is thin at one place often maps as two models from either side, each of which reaches a photograph or two across.
One photograph that both hold gives rotation and place, and the points that both see in it give the scale.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2  # noqa: F401 - before pycolmap, whose PNG library otherwise crashes OpenCV's
import numpy as np
import pycolmap
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LEAST = 5  # points that both models see in one photograph: refined as they are, each tells the scale to a thousandth
_SPREAD = 0.1  # robust relative spread of the scale that single points give, beyond which two models do not fit


def join(models: Sequence[pycolmap.Reconstruction]) -> tuple[pycolmap.Reconstruction, list[pycolmap.Reconstruction], bool]:
    """Return the first model with the photographs of all others that fit it, the others that do not, and whether any did.

    The points of the joined photographs are not taken over: triangulate again. The first model is changed in place.
    """
    block, rest, joined = models[0], list(models[1:]), False
    while True:
        for other in rest:
            if new := sorted(set(other.reg_image_ids()) - set(block.reg_image_ids())):
                similarity = similarity_between(other, block)
                if similarity is None:
                    continue
                for image_id in new:
                    _add(block, other.images[image_id], similarity)
                joined = True
                rest.remove(other)
                break
        else:
            return block, [m for m in rest if set(m.reg_image_ids()) - set(block.reg_image_ids())], joined


def _add(block: pycolmap.Reconstruction, source: pycolmap.Image, similarity: pycolmap.Sim3d) -> None:
    """Add a photograph of another model, with its keypoints but without their points."""
    if not block.exists_camera(source.camera_id):
        block.add_camera(pycolmap.Camera(source.camera))
        block.add_rig(pycolmap.Rig(source.frame.rig))
    if not block.exists_image(source.image_id):
        frame = pycolmap.Frame(frame_id=source.frame_id, rig_id=source.frame.rig_id)
        frame.add_data_id(source.data_id)
        block.add_frame(frame)
        places = np.array([p.xy for p in source.points2D]).reshape(-1, 2)
        image = pycolmap.Image(name=source.name, keypoints=places, camera_id=source.camera_id, image_id=source.image_id)
        image.frame_id = source.frame_id
        block.add_image(image)
    pose = similarity.transform_camera_world(source.cam_from_world())
    block.frames[source.frame_id].set_cam_from_world(source.camera_id, pose)
    block.register_frame(source.frame_id)


def similarity_between(source: pycolmap.Reconstruction, target: pycolmap.Reconstruction) -> pycolmap.Sim3d | None:
    """Return the similarity to ``target``'s frame from ``source``'s, None when they share too little or do not fit."""
    shared: tuple[int, Array, int] | None = None
    for image_id in sorted(set(source.reg_image_ids()) & set(target.reg_image_ids())):
        ratios = _distance_ratios(source, target, image_id)
        if len(ratios) >= _LEAST and (shared is None or len(ratios) > shared[0]):
            shared = len(ratios), ratios, image_id
    if shared is None:
        return None
    _, ratios, image_id = shared
    scale = float(np.median(ratios))
    if 1.4826 * float(np.median(np.abs(ratios - scale))) > _SPREAD * scale:
        return None
    from_source, from_target = source.images[image_id].cam_from_world(), target.images[image_id].cam_from_world()
    rotation = from_target.rotation.inverse() * from_source.rotation
    centre_s, centre_t = (m.images[image_id].projection_center() for m in (source, target))
    return pycolmap.Sim3d(scale, rotation, centre_t - scale * (rotation.matrix() @ centre_s))


def _distance_ratios(source: pycolmap.Reconstruction, target: pycolmap.Reconstruction, image_id: int) -> Array:
    """Return how much farther from a photograph the points are in ``target`` than in ``source``, of those it sees in both."""
    a, b = source.images[image_id], target.images[image_id]
    both = sorted(set(a.get_observation_point2D_idxs()) & set(b.get_observation_point2D_idxs()))
    far = [
        np.array([np.linalg.norm(m.points3D[i.point2D(k).point3D_id].xyz - i.projection_center()) for k in both])
        for m, i in ((source, a), (target, b))
    ]
    return np.asarray(far[1] / far[0] if both else np.zeros(0))
