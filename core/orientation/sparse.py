"""COLMAP sparse models as plain arrays, with pycolmap kept on this side."""

from __future__ import annotations

from pathlib import Path

import cv2  # noqa: F401 - before pycolmap, whose PNG library otherwise crashes OpenCV's
import numpy as np
import pycolmap

from ..block import Block, View
from ..camera import Camera
from ..errors import InputError


def read_model(folder: Path) -> pycolmap.Reconstruction:
    """Return COLMAP's sparse model in ``folder``.

    Raises
    ------
    InputError
        When there is none, or it is damaged.
    """
    try:
        return pycolmap.Reconstruction(folder)
    except Exception as error:  # pycolmap raises what it likes for a damaged file
        raise InputError(f"The sparse model in {folder} cannot be read ({error}): run its step again.") from error


def block_from_model(model: pycolmap.Reconstruction) -> Block:
    """Return a model's registered photographs (sorted by name) and tie points as arrays."""
    images = sorted((model.images[i] for i in model.reg_image_ids()), key=lambda image: image.name)
    index_of = {image.image_id: i for i, image in enumerate(images)}
    cameras = {
        key: Camera(camera.model.name, camera.width, camera.height, tuple(map(float, camera.params)))
        for key, camera in model.cameras.items()
    }
    views = []
    for image in images:
        pose = image.cam_from_world()
        views.append(
            View(image.name, cameras[image.camera_id], np.asarray(pose.rotation.matrix()), np.array(pose.translation, float))
        )
    points = [model.points3D[key] for key in sorted(model.points3D)]
    observed = [(n, index_of[e.image_id]) for n, p in enumerate(points) for e in p.track.elements]
    pairs = np.array(observed, np.int32).reshape(-1, 2)
    return Block(
        tuple(views),
        np.array([p.xyz for p in points], float).reshape(-1, 3),
        np.array([p.error for p in points], float),
        np.array([p.track.length() for p in points], np.int32),
        pairs[:, 0],
        pairs[:, 1],
    )


def read_block(folder: Path) -> Block:
    """Return the sparse model in ``folder`` as arrays.

    Raises
    ------
    InputError
        When there is none, or it is damaged.
    """
    return block_from_model(read_model(folder))
