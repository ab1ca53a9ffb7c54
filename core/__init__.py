"""The engine: photogrammetry and change detection, with no QGIS anywhere.

Conventions, stated once:

* Image coordinates: x right, y down, the top-left CORNER of the top-left pixel at (0, 0); the centre of
  that pixel is (0.5, 0.5). This is COLMAP's convention; OpenCV and ODM's ``gcp_list.txt`` put the centre
  at (0, 0), so 0.5 is added where their numbers enter and subtracted where they leave.
* They are those of the stored, unrotated photograph.
* Poses are ``camera_from_world``: ``x_camera = rotation @ x_world + translation``; a camera looks along +z.
* The georeferenced frame is local, metric, topocentric: east, north, up (see ``core.frames``).
* Heights are positive up. Difference = after minus before. Erosion, deposition and other volumes are
  positive cubic metres, ``net = deposition - erosion``.
* NaN marks "no value" in arrays; files carry a declared nodata value. A scalar that is not determined is ``None``.
* Metres; radians inside, degrees at the door. A sigma is one standard deviation.
"""

__version__ = "0.1.0"
