"""The local frame against numbers worked out by hand."""

import numpy as np
import pytest
from pyproj import Geod, Transformer
from strandline.core.errors import InputError
from strandline.core.frames import LocalFrame, projected_crs, transformer

# The origin lies on the central meridian of UTM zone 31 (3 degrees east) at 45 degrees north.
UTM = "EPSG:32631"
NORTHING_45 = 4982950.40022644
# Radius of curvature across the meridian at 45 degrees: a / sqrt(1 - e^2 / 2).
ACROSS = 6378137.0 / np.sqrt(1 - 0.00669437999014 / 2)


@pytest.fixture
def frame():
    return LocalFrame.at(UTM, 500000.0, NORTHING_45, 0.0)


def test_origin(frame):
    assert (frame.longitude, frame.latitude) == pytest.approx((3.0, 45.0), abs=1e-9)
    assert frame.to_crs(np.zeros((1, 3)))[0] == pytest.approx([500000.0, NORTHING_45, 0.0], abs=1e-6)


@pytest.mark.parametrize(("distance", "drop"), [(500.0, 0.0195653), (1000.0, 0.0782613)])
def test_the_tangent_plane_leaves_the_ellipsoid_by_d2_over_2r(frame, distance, drop):
    assert distance**2 / (2 * ACROSS) == pytest.approx(drop, abs=1e-6)
    assert frame.to_crs(np.array([[distance, 0.0, 0.0]]))[0, 2] == pytest.approx(drop, abs=1e-6)
    assert frame.from_crs(frame.to_crs(np.array([[distance, 0.0, -drop]])))[0, 2] == pytest.approx(-drop, abs=1e-9)


def test_the_grid_is_scaled_against_the_ground(frame):
    # UTM's scale on its central meridian is 0.9996; 100 m up, the ground is longer by 100 / R, too.
    east = frame.to_crs(np.array([[100.0, 0.0, 0.0], [0.0, 100.0, 0.0]])) - [500000.0, NORTHING_45, 0.0]
    assert east[0, 0] == pytest.approx(99.96, abs=1e-5)
    assert east[1, 1] == pytest.approx(99.96, abs=1e-5)
    high = LocalFrame.at(UTM, 500000.0, NORTHING_45, 1000.0).to_crs(np.array([[100.0, 0.0, 0.0]]))[0, 0] - 500000.0
    assert high == pytest.approx(99.96 * ACROSS / (ACROSS + 1000.0), abs=1e-5)


def test_north_of_the_grid_is_turned_by_the_convergence():
    # Two degrees east of the central meridian at 45 degrees north: 2 * sin(45) degrees, to first order.
    to_utm = Transformer.from_crs("EPSG:4326", UTM, always_xy=True)
    frame = LocalFrame.at(UTM, *to_utm.transform(5.0, 45.0), 0.0)
    north = np.diff(frame.to_crs(np.array([[0.0, 0.0, 0.0], [0.0, 100.0, 0.0]])), axis=0)[0]
    assert -np.degrees(np.arctan2(north[0], north[1])) == pytest.approx(2 * np.sin(np.radians(45)), abs=2e-3)


def test_wgs84_positions_lie_where_the_geodesic_says(frame):
    longitude, latitude, _ = Geod(ellps="WGS84").fwd(3.0, 45.0, 30.0, 200.0)
    local = frame.from_wgs84(np.array([[longitude, latitude, 12.0]]))[0]
    # A geodesic of 200 m and its chord differ by 8 nm, the drop is 3 mm, 12 m of height draw it out by 0.4 mm.
    assert local == pytest.approx([100.0, 173.205081, 12.0 - 200**2 / 2 / ACROSS], abs=5e-4)


def test_round_trip_over_a_long_beach(frame):
    points = np.random.default_rng(0).uniform([-5000, -5000, -20], [5000, 5000, 80], (50, 3))
    assert frame.from_crs(frame.to_crs(points)) == pytest.approx(points, abs=1e-6)


def test_affine_is_as_near_as_it_says(frame):
    centre = np.array([500300.0, NORTHING_45 + 200.0, 7.0])
    matrix, offset = frame.affine(centre, 10.0)
    points = centre + np.array([[10.0, -10.0, 3.0], [-4.0, 9.0, -2.0]])
    assert (points - centre) @ matrix.T + offset == pytest.approx(frame.from_crs(points), abs=2e-5)


def test_grads_of_old_french_maps_are_understood():
    frame = LocalFrame.at("EPSG:27572", 600000.0, 2200000.0, 0.0)
    assert frame.latitude == pytest.approx(46.8, abs=1e-6)  # 52 grads, the origin of Lambert II
    assert frame.to_crs(np.array([[0.0, 0.0, 0.0]]))[0] == pytest.approx([600000.0, 2200000.0, 0.0], abs=1e-6)
    metre = frame.from_crs(np.array([[600000.0, 2200100.0, 0.0]]))[0]
    assert metre[1] == pytest.approx(100 / 0.99987742, abs=1e-4)  # the projection's scale at its origin


@pytest.mark.parametrize(
    ("crs", "why"),
    [
        ("EPSG:4326", "not projected"),
        ("EPSG:2263", "US survey foot"),
        ("EPSG:2048", "do not point east and north"),
        ("nonsense", "not understood"),
    ],
)
def test_a_crs_in_which_volumes_cannot_be_measured_is_refused(crs, why):
    with pytest.raises(InputError, match=why):
        projected_crs(crs)


def test_the_vertical_part_of_a_compound_crs_is_left_out():
    assert projected_crs("EPSG:2154+5720").to_epsg() == 2154


def test_a_crs_with_heights_of_its_own_is_taken_without_them():
    assert len(projected_crs("+proj=utm +zone=11 +datum=WGS84 +units=m +vunits=us-ft").axis_info) == 2


def test_a_crs_bound_to_wgs84_works():
    crs = "+proj=utm +zone=31 +ellps=intl +towgs84=-87,-98,-121 +units=m"
    frame = LocalFrame.at(crs, 500000.0, 4983000.0, 0.0)
    assert frame.to_crs(np.zeros((1, 3)))[0] == pytest.approx([500000.0, 4983000.0, 0.0], abs=1e-6)
    # The same numbers of degrees mean another place on either ellipsoid, and the towgs84 shift comes on top.
    moved = frame.from_wgs84(np.array([[frame.longitude, frame.latitude, 0.0]]))[0]
    phi, lam = np.radians(frame.latitude), np.radians(3.0)

    def radius_and_z(a, flattening):
        e2 = flattening * (2 - flattening)
        across = a / np.sqrt(1 - e2 * np.sin(phi) ** 2)
        return across * np.cos(phi), across * (1 - e2) * np.sin(phi)

    (r_wgs, z_wgs), (r_intl, z_intl) = radius_and_z(6378137.0, 1 / 298.257223563), radius_and_z(6378388.0, 1 / 297.0)
    outwards = r_wgs - r_intl + 87 * np.cos(lam) + 98 * np.sin(lam)
    north = -np.sin(phi) * outwards + np.cos(phi) * (z_wgs - z_intl + 121)
    assert moved[0] == pytest.approx(-87 * np.sin(lam) + 98 * np.cos(lam), abs=1e-2)
    assert moved[1] == pytest.approx(north, abs=1e-2)


def test_a_guessed_change_of_datum_is_refused():
    with pytest.raises(InputError, match="No reliable transformation"):
        transformer("EPSG:4326", "+proj=utm +zone=11 +ellps=intl +units=m")


def test_a_point_outside_the_projection_is_refused():
    with pytest.raises(InputError, match="outside the area"):
        LocalFrame.at(UTM, np.inf, 0.0, 0.0)
