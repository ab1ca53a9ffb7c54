"""The COLMAP database ``features.db``: cameras, photographs, keypoints, verified matches.

It can be opened by any COLMAP of the version that the engine has. Descriptors are not in it: they stay beside it, in
``cache/``. Cameras are provisional: the focal length of the metadata, or a guess, and no distortion.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path

import cv2  # noqa: F401 - before pycolmap, whose PNG library otherwise crashes OpenCV's
import numpy as np
import pycolmap
from numpy.typing import NDArray

from ..camera import Camera
from ..files import whole
from ..survey import Photograph
from .matching import PairMatches

NAME = "features.db"
_GUESS = 1.2  # focal length per longer side when the file does not tell: a lens of about 43 mm on full frame, as COLMAP's


def provisional_camera(photograph: Photograph) -> Camera:
    """Return the camera a photograph's metadata suggest: a focal length, the principal point in the middle, no distortion."""
    width, height = photograph.width, photograph.height
    focal = photograph.focal or _GUESS * max(width, height)
    return Camera("SIMPLE_RADIAL", width, height, (float(focal), width / 2, height / 2, 0.0))


def write_database(
    path: Path,
    photographs: Sequence[Photograph],
    keypoints: Iterable[NDArray[np.float32]],
    pairs: Mapping[tuple[int, int], PairMatches],
    *,
    count: int,
    before: Callable[[], None] | None = None,
) -> None:
    """Write a database whose image ids are 1 + the index in ``photographs``; ``before`` is called before it takes its place.

    ``keypoints`` (n, 4: x, y, scale, angle) come in the photographs' order, one photograph's at a time, ``count`` in all;
    ``pairs`` maps two indices, the smaller first. Photographs of one ``camera`` group and size share a camera.
    """
    # Until SQLite is closed it keeps all twice; matches are written twice; and a full disk would end the process.
    room = 3 * (16 * count + 2 * sum(p.matches.nbytes for p in pairs.values())) + (1 << 20)
    with whole(path, room=room, before=before) as part:
        database = pycolmap.Database.open(part)
        try:
            _fill(database, photographs, keypoints, pairs)
        finally:
            database.close()


def _fill(
    database: pycolmap.Database,
    photographs: Sequence[Photograph],
    keypoints: Iterable[NDArray[np.float32]],
    pairs: Mapping[tuple[int, int], PairMatches],
) -> None:
    with pycolmap.DatabaseTransaction(database):
        rigs: dict[tuple[str, int, int], tuple[int, int]] = {}
        for photograph, points in zip(photographs, keypoints, strict=True):
            group = (photograph.camera, photograph.width, photograph.height)
            if group not in rigs:
                prior = provisional_camera(photograph)
                camera = pycolmap.Camera(model=prior.model, width=prior.width, height=prior.height, params=list(prior.params))
                camera.has_prior_focal_length = photograph.focal is not None
                camera.camera_id = database.write_camera(camera)
                rig = pycolmap.Rig()
                rig.add_ref_sensor(camera.sensor_id)
                rigs[group] = camera.camera_id, database.write_rig(rig)
            camera_id, rig_id = rigs[group]
            image = pycolmap.Image(name=photograph.name, camera_id=camera_id)
            image.image_id = database.write_image(image)
            frame = pycolmap.Frame(rig_id=rig_id)
            frame.add_data_id(image.data_id)
            database.write_frame(frame)
            database.write_keypoints(image.image_id, np.asarray(points, np.float32))
        for (i, j), pair in sorted(pairs.items()):
            database.write_matches(i + 1, j + 1, pair.matches.astype(np.uint32))
            geometry = pycolmap.TwoViewGeometry()
            geometry.config = pycolmap.TwoViewGeometryConfiguration(pair.config)
            geometry.E, geometry.F, geometry.H = pair.essential, pair.fundamental, pair.homography
            geometry.inlier_matches = pair.matches.astype(np.uint32)
            database.write_two_view_geometry(i + 1, j + 1, geometry)
