"""From photographs to numbers through qgis_process alone: a simulated beach by the ready model, real photographs step by step."""

import json
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# The engine's own Python: Debian's has no library that keeps EXIF and XMP of a reduced photograph.
REDUCE = """
import sys
from pathlib import Path
from PIL import Image
source, target, factor = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
for path in sorted(source.glob("*.JPG")):
    with Image.open(path) as image:
        small = image.resize((image.width // factor, image.height // factor), Image.Resampling.BOX)
        exif = image.getexif()
        exif.get_ifd(0x8769).pop(0xA20E, None)  # the sensor's pixels per unit are no longer those of the file
        small.save(target / path.name, quality=95, exif=exif, xmp=image.info["xmp"])
"""


@pytest.fixture
def step(qgis_process):
    """Run an algorithm that must succeed; return its results as text."""

    def run(algorithm, **parameters):
        words = [f"{name}={value}" for name, value in parameters.items()]
        status, told, errors = qgis_process.run("run", algorithm, "--", *words)
        assert status == 0, errors[-3000:]
        return dict(re.findall(r"^([\w:]+):\t(.*)$", told.partition("Results")[2], re.MULTILINE))

    return run


def test_two_simulated_surveys_become_volumes_in_one_model(step, qgis_process, tmp_path):
    simulation, volumes, difference = tmp_path / "simulation", tmp_path / "volumes.gpkg", tmp_path / "difference.tif"
    step(
        "strandline:simulatesurvey", OUTPUT=simulation, LENGTH=30, WIDTH=24, HEIGHT=45, FORWARD_OVERLAP=75, SIDE_OVERLAP=60,
        CAMERA_WIDTH=800, CAMERA_HEIGHT=600, FOCAL=650, CONTRAST=0.06, GCP_COUNT=6, CHECK_COUNT=0,
    )  # fmt: skip
    _, told, _ = qgis_process.run("help", "strandline:Two surveys to volumes")
    before, after = sorted(path for path in simulation.iterdir() if (path / "jpg").is_dir())
    # A model's results are called child:name in 3.22 and name in later versions.
    names = {
        key: re.search(rf"^((?:\w+:)?{key}):", told, re.MULTILINE).group(1)
        for key in ("BEFORE_SURVEY", "BEFORE_DSM", "AFTER_SURVEY", "AFTER_DSM", "DIFFERENCE", "VOLUMES", "REPORT")
    }
    step(
        "strandline:Two surveys to volumes",
        BEFORE_IMAGES=before / "jpg", BEFORE_GCPS=before / "gcps.gpkg", BEFORE_NAME_FIELD="name",
        BEFORE_MARKS=before / "marks.csv",
        AFTER_IMAGES=after / "jpg", AFTER_GCPS=after / "gcps.gpkg", AFTER_NAME_FIELD="name",
        AFTER_MARKS=after / "marks.csv",
        GCP_HEIGHTS="ellipsoidal", GNSS_HEIGHTS="ellipsoidal", RESOLUTION=0.15,
        STABLE=simulation / "stable.gpkg", ZONES=simulation / "zones.gpkg",
        **{
            names["BEFORE_SURVEY"]: tmp_path / "before", names["BEFORE_DSM"]: tmp_path / "before.tif",
            names["AFTER_SURVEY"]: tmp_path / "after", names["AFTER_DSM"]: tmp_path / "after.tif",
            names["DIFFERENCE"]: difference, names["VOLUMES"]: volumes, names["REPORT"]: tmp_path / "report.html",
        },
    )  # fmt: skip

    from qgis.core import QgsRasterLayer, QgsVectorLayer

    assert QgsRasterLayer(str(difference), "difference").isValid()
    truth = json.loads((simulation / "truth" / "volumes.json").read_text())
    expected = {zone["zone"]: zone["net"] for zone in truth["zones"]}
    layer = QgsVectorLayer(str(volumes), "volumes", "ogr")
    rows = {feature["zone"]: feature for feature in layer.getFeatures()}
    assert len(rows) >= 3
    for zone, row in rows.items():
        # Three zones of one simulation: 3.5 sigma is passed by chance less than twice in a thousand times.
        assert abs(row["net"] - expected[zone]) < 3.5 * row["sigma"], zone
        assert row["covered_percent"] > 95


def test_real_photographs_become_a_surface(step, shared_data, tmp_path):
    photographs, survey, dsm = tmp_path / "photographs", tmp_path / "survey", tmp_path / "dsm.tif"
    photographs.mkdir()
    source = shared_data / "brighton" / "images"
    subprocess.run([ROOT / ".engine" / "bin" / "python", "-c", REDUCE, source, photographs, "3"], check=True, timeout=120)
    made = step("strandline:createsurvey", IMAGES=photographs, OUTPUT=survey)
    assert made["POSITION_COUNT"] == "8"
    step("strandline:enhance", SURVEY=survey)
    step("strandline:tiepoints", SURVEY=survey)
    oriented = step("strandline:orient", SURVEY=survey)
    assert oriented["ORIENTED_COUNT"] == "8"
    ground = step("strandline:georeference", SURVEY=survey, CRS="EPSG:32615")
    # What its GNSS gives, within half a metre in plan; the full photographs do no better.
    assert float(ground["PLANI_GNSS"]) < 0.6
    assert float(ground["ALTI_GNSS"]) < 0.5
    surface = step("strandline:exportdsm", SURVEY=survey, RESOLUTION=0.2, OUTPUT=dsm, ORTHO=tmp_path / "ortho.tif")
    # Flown at 40 m: 1.7 cm a pixel, 5.2 at a third of the size. Lawn, roads and shore are half of the area, trees and lake the
    # rest.
    assert float(surface["GSD"]) == pytest.approx(0.052, rel=0.08)
    assert 30 < float(surface["COVERAGE_PERCENT"]) < 75

    from osgeo import gdal

    raster = gdal.Open(str(dsm))
    assert raster.GetRasterBand(1).GetNoDataValue() == -9999
    assert raster.GetMetadataItem("LAYOUT", "IMAGE_STRUCTURE") == "COG"
    low, high = raster.GetRasterBand(1).ComputeRasterMinMax(False)
    assert 3 < high - low < 25  # metres of relief, roofs and bushes with it
