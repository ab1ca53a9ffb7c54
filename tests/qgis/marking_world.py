"""A small survey with photographs, ground points and marks' tables, for the tests of marking; no engine is needed."""

import json

from osgeo import gdal, ogr, osr

WIDTH, HEIGHT = 640, 480
NAMES = ("flight/a.png", "flight/b.png", "flight/c.png")


def make_survey(folder, *, positions=True, steps=()):
    """Write photographs and a survey.json; photograph i was taken i * 0.001 degrees (80 m) east of the first."""
    for name in NAMES:
        make_photograph(folder / "images" / name)
    survey = folder / "survey"
    survey.mkdir()
    content = {
        "version": 1,
        "images": "../images",
        "crs": None,
        "photographs": [
            {
                "name": name,
                "bytes": (folder / "images" / name).stat().st_size,
                "digest": "0",
                "width": WIDTH,
                "height": HEIGHT,
                "camera": "c",
                "position": {"longitude": 3.0 + 0.001 * i, "latitude": 45.0, "height": 50.0} if positions else None,
            }
            for i, name in enumerate(NAMES)
        ],
        "steps": {s: {"fingerprint": s, "built_on": {}, "parameters": {}, "result": {}, "finished": ""} for s in steps},
    }
    (survey / "survey.json").write_text(json.dumps(content))
    return survey


def make_photograph(path, width=WIDTH, height=HEIGHT, kind="PNG", value=None):
    """Write a photograph whose red is x / 4 and whose green is y / 4."""
    path.parent.mkdir(parents=True, exist_ok=True)
    data = gdal.GetDriverByName("MEM").Create("", width, height, 3)
    red = bytes(min(255, x // 4) for x in range(width))
    for y in range(height):
        data.GetRasterBand(1).WriteRaster(0, y, width, 1, red)
        data.GetRasterBand(2).WriteRaster(0, y, width, 1, bytes([min(255, y // 4)]) * width)
    options = ["QUALITY=98"] if kind == "JPEG" else []
    gdal.GetDriverByName(kind).CreateCopy(str(path), data, options=options)


def make_points(path):
    """Write three ground points in WGS 84: B lies under the second photograph, A under the first, C under the third."""
    reference = osr.SpatialReference()
    reference.ImportFromEPSG(4326)
    reference.SetAxisMappingStrategy(osr.OAMS_TRADITIONAL_GIS_ORDER)
    data = ogr.GetDriverByName("GPKG").CreateDataSource(str(path))
    layer = data.CreateLayer("gcps", reference, ogr.wkbPoint25D)
    for name in ("name", "role"):
        layer.CreateField(ogr.FieldDefn(name, ogr.OFTString))
    for name, place in (("B", 3.001), ("A", 3.0), ("C", 3.002)):
        feature = ogr.Feature(layer.GetLayerDefn())
        feature.SetField("name", name)
        feature.SetField("role", "control")
        feature.SetGeometry(ogr.CreateGeometryFromWkt(f"POINT Z ({place} 45 5)"))
        layer.CreateFeature(feature)
    return path


def open_layer(path, name=None):
    from qgis.core import QgsVectorLayer

    layer = QgsVectorLayer(str(path), name or path.stem, "ogr")
    assert layer.isValid()
    return layer
