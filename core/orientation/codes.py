"""Finding a coded target, ArUco or AprilTag, within a circle of a photograph.

OpenCV finds and reads the codes; the ideal code is then laid on the image by a homography that maximises their correlation (ECC,
Evangelidis and Psarakis 2008). The homography takes the code's centre to where its diagonals meet, which is the centre under any
perspective, and the correlation is the score.
"""

from __future__ import annotations

import re

import cv2
import numpy as np
from numpy.typing import NDArray

from .targets import Found

Array = NDArray[np.float64]

# The larger dictionary of a size begins with the codes of the smaller ones, so that it serves for all of them.
DICTIONARIES = {
    "ArUco 4x4": cv2.aruco.DICT_4X4_1000,
    "ArUco 5x5": cv2.aruco.DICT_5X5_1000,
    "ArUco 6x6": cv2.aruco.DICT_6X6_1000,
    "ArUco 7x7": cv2.aruco.DICT_7X7_1000,
    "ArUco original": cv2.aruco.DICT_ARUCO_ORIGINAL,
    "ArUco MIP 36h12": cv2.aruco.DICT_ARUCO_MIP_36h12,
    "AprilTag 16h5": cv2.aruco.DICT_APRILTAG_16h5,
    "AprilTag 25h9": cv2.aruco.DICT_APRILTAG_25h9,
    "AprilTag 36h10": cv2.aruco.DICT_APRILTAG_36h10,
    "AprilTag 36h11": cv2.aruco.DICT_APRILTAG_36h11,
}
_MODULE = 8  # px of the ideal code per module
_QUIET = 4  # px of white around it
_BLUR = 5  # px, odd: of the Gaussian with which ECC smooths both
_ENLARGED = 800  # px, up to which a crop is doubled: OpenCV does not see codes of less than some 20 pixels
_PRECISION = 0.03  # px, one sigma of the centre: what simulated codes scatter by


def code_of(name: str) -> int | None:
    """Return the number of the code that a ground point's name means: the number it ends with, None without one.

    >>> code_of("12"), code_of("GCP_007"), code_of("tag 3"), code_of("north")
    (12, 7, 3, None)
    """
    number = re.search(r"(\d{1,6})\s*$", name)
    return int(number.group(1)) if number else None


def find_code(image: NDArray[np.float32], code: int, centre: Array, radius: float) -> Found | None:
    """Return the code of this number whose centre lies within ``radius`` of ``centre`` (px from the image's corner).

    The score is the correlation with the ideal code; two codes of the same number and family leave ``1 - q**2`` of it, where
    ``q`` is the ratio of theirs.
    """
    grey = _stretched(image)
    factor = 2 if max(grey.shape) < _ENLARGED else 1
    if factor > 1:
        grey = cv2.resize(grey, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
    found: list[Found] = []
    for corners, name in _detected(grey, code):
        laid = _laid(grey, name, code, corners)
        if laid is None:
            continue
        place, score = (laid[0] + 0.5) / factor, laid[1]
        if np.hypot(*(place - centre)) <= radius:
            found.append(Found(float(place[0]), float(place[1]), _PRECISION, score, f"{name}, number {code}"))
    if not found:
        return None
    found.sort(key=lambda f: -f.score)
    best = found[0]
    others = [f.score for f in found[1:] if np.hypot(f.x - best.x, f.y - best.y) > 5.0]
    rival = max([*others, 0.0]) / best.score
    return Found(best.x, best.y, best.sigma, best.score * (1.0 - rival**2), best.what)


def _detected(grey: NDArray[np.uint8], code: int) -> list[tuple[NDArray[np.float32], str]]:
    """Return the corners (4, 2) of all codes of this number, and their dictionaries."""
    # Dictionaries of the one code: to compare each dark square with thousands of codes takes seconds.
    families, dictionaries = [], []
    for name, key in DICTIONARIES.items():
        full = cv2.aruco.getPredefinedDictionary(key)
        if code < len(full.bytesList):
            families.append(name)
            dictionaries.append(cv2.aruco.Dictionary(full.bytesList[code : code + 1], full.markerSize, full.maxCorrectionBits))
    if not families:
        return []
    corners, numbers, _, used = cv2.aruco.ArucoDetector(dictionaries, _options()).detectMarkersMultiDict(grey)
    if numbers is None:
        return []
    return [(np.asarray(c, np.float32).reshape(4, 2), families[int(d)]) for c, d in zip(corners, np.ravel(used), strict=True)]


def _options() -> cv2.aruco.DetectorParameters:
    options = cv2.aruco.DetectorParameters()
    options.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    options.errorCorrectionRate = 0.3  # few wrong bits, for many families are tried
    options.minMarkerPerimeterRate = 0.02
    return options


def _laid(grey: NDArray[np.uint8], name: str, code: int, corners: NDArray[np.float32]) -> tuple[Array, float] | None:
    """Return the centre (2,) of the ideal code laid on the image (pixel centres at whole numbers) and the correlation."""
    ideal = _ideal(name, code)
    side = ideal.shape[0] - 2 * _QUIET
    low, high = _QUIET - 0.5, _QUIET + side - 0.5
    square = np.array([[low, low], [high, low], [high, high], [low, high]], np.float32)
    start = cv2.getPerspectiveTransform(square, corners).astype(np.float32)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 60, 1e-6)
    try:
        score, warp = cv2.findTransformECC(ideal, grey, start, cv2.MOTION_HOMOGRAPHY, criteria, None, _BLUR)
    except cv2.error:  # it does not converge
        return None
    middle = (ideal.shape[0] - 1) / 2
    x, y, w = np.asarray(warp, float) @ [middle, middle, 1.0]
    if np.hypot(*(np.array([x, y]) / w - corners.mean(axis=0))) > 0.25 * np.hypot(*(corners[0] - corners[2])):
        return None
    return np.array([x / w, y / w]), float(np.clip(score, 0.0, 1.0))


def _ideal(name: str, code: int) -> NDArray[np.uint8]:
    dictionary = cv2.aruco.getPredefinedDictionary(DICTIONARIES[name])
    side = (dictionary.markerSize + 2) * _MODULE
    drawn = cv2.aruco.generateImageMarker(dictionary, code, side)
    return np.asarray(np.pad(drawn, _QUIET, constant_values=255), np.uint8)


def _stretched(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    low, high = np.percentile(image, [0.5, 99.5])
    return np.asarray(np.clip(255.0 * (image - low) / max(float(high - low), 1e-9), 0, 255), np.uint8)
