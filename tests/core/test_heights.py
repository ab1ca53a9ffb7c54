"""Kinds of heights, geoids, and the proof that no height passes unchanged where a grid is missing."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyproj.network
import pytest
import strandline.core
from pyproj import CRS, Transformer
from strandline.core.errors import InputError
from strandline.core.frames import transformer
from strandline.core.orientation.control import Given, in_metres
from strandline.core.orientation.heights import kind_of_crs, stated_kind, undulation, undulation_of_crs
from strandline.core.raster import Grid, Patch, write_cog

UTM = "EPSG:32631"
CORE = Path(strandline.core.__file__).parent
# With a place in each: NN2000, mean sea level, NAP, NAVD 88 (twice), IGN69, New York in feet.
COMPOUND = {
    "EPSG:5972": (9.0, 60.0),
    "EPSG:9705": (9.0, 50.0),
    "EPSG:7415": (5.0, 52.0),
    "EPSG:5498": (-100.0, 40.0),
    "EPSG:6349": (-100.0, 40.0),
    "EPSG:2154+5720": (3.0, 46.0),
    "EPSG:2263+6360": (-73.5, 40.8),
}


@pytest.fixture(autouse=True)
def no_network():
    """Grids must not come from the network, whatever the machine allows."""
    pyproj.network.set_network_enabled(False)


# Geoids


@pytest.mark.parametrize("text", ["47.25", " 47,25 ", "47.25 m", "47,25m"])
def test_a_constant_may_have_a_decimal_comma_and_its_unit(text):
    assert undulation(text, np.zeros((2, 3)), UTM).tolist() == [47.25, 47.25]


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("nan", "neither a number nor a file"),
        ("", "neither a number nor a file"),
        ("1,234.5", "neither a number nor a file"),
        ("4725", "no geoid is more than 120 m from the ellipsoid"),
        ("-155", "GEOID -155 is -155 m"),
    ],
)
def test_what_is_no_geoid_is_refused(text, why):
    with pytest.raises(InputError, match=why):
        undulation(text, np.zeros((1, 3)), UTM)


def geoid(path, values, *, crs=UTM, cell=500.0, west=511000.0, north=4984000.0, nodata_at=None):
    values = np.array(values, np.float32)
    if nodata_at is not None:
        values[nodata_at] = np.nan
    grid = Grid(west, north, cell, values.shape[1], values.shape[0], CRS.from_user_input(crs).to_wkt())
    write_cog(str(path), grid, [Patch(0, 0, values[None])])
    return str(path)


def test_a_raster_is_read_between_cell_centres_in_any_crs(tmp_path):
    # Undulation = 40 + column + 2 row, on cells of 0.01 degrees whose first centre lies at 3.005 E, 45.095 N.
    row, column = np.mgrid[0:10, 0:30]
    path = geoid(tmp_path / "n.tif", 40.0 + column + 2.0 * row, crs="EPSG:4326", cell=0.01, west=3.0, north=45.1)
    place = Transformer.from_crs("EPSG:4326", UTM, always_xy=True).transform(3.015 + 0.0025, 45.095 - 0.005)
    assert undulation(path, np.array([place]), UTM) == pytest.approx([41.0 + 0.25 + 1.0], abs=1e-5)


@pytest.mark.parametrize("place", [(511600.0, 4983600.0), (512000.0, 4983400.0)])
def test_a_hole_beside_the_position_is_refused(tmp_path, place):
    path = geoid(tmp_path / "n.tif", np.full((4, 5), 47.0), nodata_at=(1, 1))
    assert undulation(path, np.array([[512900.0, 4982400.0]]), UTM) == pytest.approx([47.0])
    with pytest.raises(InputError, match="has no value at 1 of 2 positions: give one that covers the survey"):
        undulation(path, np.array([place, (512900.0, 4982400.0)]), UTM)


@pytest.mark.parametrize("factor", [100.0, 1000.0])
def test_a_raster_in_another_unit_is_refused(tmp_path, factor):
    path = geoid(tmp_path / "n.tif", np.full((4, 5), 47.0) * factor)
    with pytest.raises(InputError, match="give the geoid's height above the ellipsoid in metres"):
        undulation(path, np.array([[512000.0, 4983000.0]]), UTM)


def test_a_raster_that_declares_feet_is_refused(tmp_path):
    import rasterio

    path = geoid(tmp_path / "n.tif", np.full((4, 5), 47.0))
    with rasterio.open(path, "r+", IGNORE_COG_LAYOUT_BREAK="YES") as file:
        file.set_band_unit(1, "ft")
    with pytest.raises(InputError, match="declares its heights in 'ft': convert them to metres"):
        undulation(path, np.array([[512000.0, 4983000.0]]), UTM)


# What a CRS says


@pytest.mark.parametrize(
    ("crs", "kind"),
    [
        (None, "unknown"),
        (UTM, "unknown"),
        ("EPSG:4326", "unknown"),
        ("EPSG:4979", "ellipsoidal"),
        ("EPSG:4978", "unknown"),  # geocentric: its third axis is no height
        *((crs, "orthometric") for crs in COMPOUND),
    ],
)
def test_the_kind_of_heights_that_a_crs_says(crs, kind):
    assert kind_of_crs(crs) == kind


def test_a_crs_decides_what_was_not_said_and_refuses_what_contradicts_it():
    assert stated_kind("unknown", UTM, "gcps") == ("unknown", ())
    assert stated_kind("orthometric", "EPSG:5972", "gcps") == ("orthometric", ())
    kind, notes = stated_kind("unknown", "EPSG:5972", "gcps")
    assert kind == "orthometric"
    assert notes == ("The heights of gcps are taken as orthometric, as its CRS ETRS89 / UTM zone 32N + NN2000 height says.",)
    with pytest.raises(
        InputError, match="GCP_HEIGHTS is ellipsoidal but the CRS of gcps, .*NN2000 height, has orthometric heights"
    ):
        stated_kind("ellipsoidal", "EPSG:5972", "gcps")


# Missing grids


@pytest.mark.parametrize(("crs", "place"), COMPOUND.items())
def test_a_missing_grid_is_a_sentence_never_an_unchanged_height(crs, place):
    compound = CRS.from_user_input(crs)
    base = CRS(compound.sub_crs_list[0]).geodetic_crs
    # What PROJ does when nobody forbids it: 100 m above the ellipsoid come out as 100 m above the sea.
    careless = Transformer.from_crs(base.to_3d(), compound, always_xy=True)
    metres = compound.axis_info[2].unit_conversion_factor
    assert careless.transform(*place, 100.0)[2] * metres == pytest.approx(100.0)
    with pytest.raises(InputError, match=r"PROJ has no grid installed for .* at the survey: give GEOID\."):
        undulation_of_crs(crs, np.array([place]), "EPSG:4326")


@pytest.mark.parametrize("crs", COMPOUND)
def test_a_transformer_knows_no_heights(crs):
    change = transformer(crs, "EPSG:4979")
    assert len(change.source_crs.axis_info) == len(change.target_crs.axis_info) == 2


def test_ground_points_in_a_compound_crs_keep_their_heights_in_its_reference():
    """The block is put in the reference of its ground points; nothing is asked of PROJ, so no grid can be missing."""
    place = np.array([[500000.0, 6651411.0, 12.5]])
    moved = in_metres(Given("gcps", "EPSG:5972", ("A",), place), "EPSG:25832")
    assert moved == pytest.approx(place, abs=1e-6)


def test_an_installed_grid_is_used(tmp_path):
    """A grid under the name that PROJ asks for, 47.25 m all over; in a process of its own, for PROJ keeps what it has found."""
    import rasterio

    path = tmp_path / "us_nga_egm96_15.tif"
    profile = {"driver": "GTiff", "width": 360, "height": 181, "count": 1, "dtype": "float32", "crs": "EPSG:4979"}
    with rasterio.open(path, "w", **profile, transform=rasterio.Affine(1, 0, -180.5, 0, -1, 90.5)) as file:
        file.write(np.full((1, 181, 360), 47.25, np.float32))
        file.update_tags(AREA_OR_POINT="Point", TYPE="VERTICAL_OFFSET_GEOGRAPHIC_TO_VERTICAL")
        file.set_band_description(1, "geoid_undulation")
        file.set_band_unit(1, "metre")
    script = (
        "import sys, pyproj, numpy as np; pyproj.datadir.append_data_dir(sys.argv[1])\n"
        "from strandline.core.orientation.heights import undulation_of_crs\n"
        "print(undulation_of_crs('EPSG:4326+5773', np.array([[500000.0, 5000000.0, 7.0]]), 'EPSG:32631')[0])"
    )
    done = subprocess.run([sys.executable, "-c", script, str(tmp_path)], capture_output=True, text=True, check=False)
    assert done.stderr == ""
    # The undulation is the geoid's height ABOVE the ellipsoid, whatever sign the grid's users know it by.
    assert float(done.stdout) == pytest.approx(47.25, abs=1e-3)


def calls(tree):
    """Yield the calls that make a transformer."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            owner = ast.unparse(node.func.value)
            if owner.split(".")[-1] in ("Transformer", "TransformerGroup") or node.func.attr in ("itransform", "from_pipeline"):
                yield node


def test_every_transformer_of_the_engine_forbids_guesses_or_stays_in_one_datum():
    """Between a CRS and its own geographic base PROJ needs no grid, and a pipeline of ``cart`` knows none."""
    seen = 0
    for path in sorted(CORE.rglob("*.py")):
        for call in calls(ast.parse(path.read_text(encoding="utf-8"))):
            seen += 1
            text = ast.unparse(call)
            forbids = any(k.arg == "allow_ballpark" and ast.unparse(k.value) == "False" for k in call.keywords)
            source, target = [*map(ast.unparse, call.args), "", ""][:2]
            own_base = source == f"{target}.geodetic_crs" or target == f"{source}.geodetic_crs"
            pipeline = "+proj=cart" in text and "grid" not in text
            assert forbids or own_base or pipeline, f"{path.name}:{call.lineno}: {text}"
    assert seen >= 6  # the test would pass of itself if it found none
