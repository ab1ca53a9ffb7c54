"""Beaches whose truth is known, surveyed with errors that are known too."""

import numpy as np
import shapely
from conftest import correlated_field

SHAPE = (90, 120)  # rows, columns of 1 m
DATES = ("2020-01-01", "2020-05-01", "2020-09-01", "2021-01-01")


def true_surface(k):
    """A beach that falls to the east and rises by 2 cm a date in its middle; its westernmost 25 m stay as they are."""
    rows, columns = SHAPE
    x = (np.arange(columns) + 0.5)[None, :] + np.zeros((rows, 1))
    y = (np.arange(rows) + 0.5)[:, None] + np.zeros((1, columns))
    bump = np.exp(-(((x - 65) / 18) ** 2) - ((y - 45) / 25) ** 2)
    return np.where(x < 25, 4.0, 4.0 - 0.05 * (x - 25)) + 0.02 * k * bump * (x > 25)


def surveyed(random, k, *, white=0.02, sill=0.02, reach=12.0, level=0.05, size=1.0):
    """The surface as a flight measures it: noise, errors that neighbours share, a level of its own."""
    error = white * random.standard_normal(SHAPE) + sill * correlated_field(random, (180, 240), reach)[: SHAPE[0], : SHAPE[1]]
    return true_surface(k) + size * error + level * random.standard_normal()


STABLE = [shapely.box(2, -88, 20, -2)]
ZONES = [shapely.box(40, -80, 60, -50), shapely.box(50, -45, 110, -30), shapely.box(70, -25, 100, -5)]
LINES = [shapely.LineString([(26, y), (112, y + 3)]) for y in (-70, -62, -40, -15)]
