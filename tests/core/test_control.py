"""Ground control from layers and tables, as users keep them."""

import numpy as np
import pytest
import shapely
from pyproj import Transformer
from strandline.core.contract import VectorSource
from strandline.core.errors import InputError
from strandline.core.orientation.control import Given, control_from, given_from_layers, in_metres
from strandline.core.orientation.marks import Mark, match_names, match_photograph, predictions_among
from strandline.core.survey import Photograph
from strandline.core.vector import Layer, write_layer

UTM = "EPSG:32631"
PHOTOS = [Photograph(n, 1, "x", 4000, 3000, "c") for n in ("DJI_0001.JPG", "DJI_0002.JPG", "east/IMG_1.CR2", "west/IMG_1.CR2")]
PLACES = np.array([[500000.0, 4983000.0, 3.0], [500050.0, 4983010.0, 4.0], [500020.0, 4983060.0, 2.0]])


def given(**changes):
    values = {"where": "gcps", "crs": UTM, "names": ("A", "B", "C"), "coordinates": PLACES}
    return Given(**{**values, **changes})


def control(**changes):
    options = {k: changes.pop(k) for k in ("check", "sigma_h") if k in changes}
    return control_from(given(**changes), UTM, PHOTOS, **{"sigma_h": 0.01, "sigma_v": 0.02, **options})


def layer(path, fields, shapes, crs=UTM, kind="Point Z"):
    write_layer(str(path), "gcps", crs, fields, shapes, kind)
    return VectorSource(str(path), "gcps")


def test_layer_and_table(tmp_path):
    fields = {"Name": ["A", "B"], "H": ["3.5", None], "Use": ["Check", None], "SH": [0.5, None]}
    points = layer(tmp_path / "g.gpkg", fields, list(shapely.points(PLACES[:2])))
    table = tmp_path / "marks.csv"
    table.write_text('IMAGE,Gcp,Y,x\ndji_0001,a,"20","10.25"\n', encoding="utf-8")
    marks = VectorSource(str(table), "marks")
    read = given_from_layers(
        points, marks, name_field="name", height_field=None, role_field="use", sigma_h_field="sh", sigma_v_field=None
    )
    assert read.coordinates == pytest.approx(PLACES[:2])
    found = control_from(read, UTM, PHOTOS, sigma_h=0.01, sigma_v=0.02)
    assert [(p.name, p.check, p.sigma_h, p.sigma_v) for p in found.points] == [("A", True, 0.5, 0.02), ("B", False, 0.01, 0.02)]
    assert found.points[0].marks == (Mark("A", "DJI_0001.JPG", 10.25, 20.0),)  # pixels from the corner: as they are
    with pytest.raises(InputError, match="B of gcps has no complete coordinates"):
        control_from(
            given_from_layers(points, None, name_field="Name", height_field="H"), UTM, PHOTOS, sigma_h=0.01, sigma_v=0.02
        )


def test_multipoints_of_one_point_are_points(tmp_path):
    points = layer(tmp_path / "g.gpkg", {"n": [1]}, [shapely.MultiPoint([PLACES[0]])], kind="MultiPoint Z")
    read = given_from_layers(points, None, name_field="n", height_field=None)
    assert read.names == ("1",)
    assert read.coordinates == pytest.approx(PLACES[:1])


@pytest.mark.parametrize(
    ("shapes", "kind", "fields", "why"),
    [
        ([], "Point Z", {"n": []}, "is empty"),
        ([shapely.Point(1, 2)], "Point", {"n": ["A"]}, "no heights"),
        ([shapely.Point(1, 2, 3)], "Point Z", {"n": [None]}, "has no name"),
        ([shapely.LineString([(1, 2, 3), (2, 3, 4)])], "LineString Z", {"n": ["A"]}, "not one point"),
        ([None], "Point Z", {"n": ["A"]}, "A of gcps has no geometry"),
        ([shapely.Point()], "Point Z", {"n": ["A"]}, "A of gcps has no geometry"),
        ([shapely.MultiPoint([(1, 2, 3), (2, 3, 4)])], "MultiPoint Z", {"n": ["A"]}, "A of gcps is not one point"),
        ([shapely.box(0, 0, 1, 1)], "Polygon", {"n": ["A"]}, "A of gcps is not one point"),
    ],
)
def test_layers_that_are_no_control(tmp_path, shapes, kind, fields, why):
    with pytest.raises(InputError, match=why):
        given_from_layers(layer(tmp_path / "g.gpkg", fields, shapes, kind=kind), None, name_field="n", height_field=None)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("gcp,image,x,y\n", "is empty"),
        ("gcp,image,x\nA,a,1\n", "no field 'y'"),
        ("gcp,image,x,y\nA,a,1,\n", "row 1"),
        ("gcp,image,x,y\nA,a,1,2\n,a,1,2\n", "row 2"),
        ("gcp,image,x,y\nA,a,1,two\n", "'two' in the field y"),
    ],
)
def test_tables_that_are_no_marks(tmp_path, text, why):
    points = layer(tmp_path / "g.gpkg", {"n": ["A"]}, [shapely.Point(*PLACES[0])])
    table = tmp_path / "marks.csv"
    table.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=why):
        given_from_layers(points, VectorSource(str(table), "marks"), name_field="n", height_field=None)


@pytest.mark.parametrize(
    "text",
    [
        "gcp;image;x;y\nA;DJI_0001;10,25;20\n",
        'gcp,image,x,y\nA,DJI_0001,"10,25","20"\n',
        "gcp\timage\tx\ty\nA\tDJI_0001\t10.25\t2e1\n",
        '\ufeffgcp;image;x;y\r\n"A";"DJI_0001";"10,25";" 20 "\r\n',
    ],
)
def test_tables_of_marks_as_spreadsheets_write_them(tmp_path, text):
    points = layer(tmp_path / "g.gpkg", {"n": ["A"]}, [shapely.Point(*PLACES[0])])
    table = tmp_path / "marks.csv"
    table.write_text(text, encoding="utf-8")
    read = given_from_layers(points, VectorSource(str(table), "marks"), name_field="n", height_field=None)
    assert read.marks == (Mark("A", "DJI_0001", 10.25, 20.0),)


@pytest.mark.parametrize(
    ("image", "name"),
    [
        ("DJI_0001.JPG", "DJI_0001.JPG"),
        ("dji_0001.jpg", "DJI_0001.JPG"),
        ("  DJI_0001 ", "DJI_0001.JPG"),
        ("DJI_0001.tif", "DJI_0001.JPG"),
        (r"D:\flight\DJI_0002.JPG", "DJI_0002.JPG"),
        ("east/IMG_1", "east/IMG_1.CR2"),
        ("flight/WEST/img_1.jpg", "west/IMG_1.CR2"),
        ("DJI_0003.JPG", None),
    ],
)
def test_images_match_forgivingly(image, name):
    assert match_photograph(image, PHOTOS) == name


def test_an_image_that_could_be_two_is_refused():
    with pytest.raises(InputError, match=r"east/IMG_1\.CR2 or west/IMG_1\.CR2"):
        match_photograph("IMG_1.CR2", PHOTOS)


def test_what_does_not_match_is_listed():
    found = control(marks=(Mark(" a ", "DJI_0001", 1, 2), Mark("D", "DJI_0001", 5, 6), Mark("A", "IMG_9.JPG", 3, 4)))
    assert [len(p.marks) for p in found.points] == [1, 0, 0]
    assert any("not in the survey were left out: IMG_9.JPG" in n for n in found.notes)
    assert any("not among the GCPs were left out: D" in n for n in found.notes)


@pytest.mark.parametrize(
    ("changes", "why"),
    [
        ({"names": ("A", "B", " a")}, "share a name"),
        ({"crs": None}, "no CRS"),
        ({"crs": "EPSG:999999"}, "not understood"),
        ({"roles": ("control", "spare", "")}, "role 'spare'"),
        ({"check": "B, Z"}, "'Z' of CHECK"),
        ({"sigmas": np.array([[0.01, 0.02], [0.0, 0.1], [0.1, 0.1]])}, "sigma of B"),
        ({"marks": (Mark("A", "DJI_0001", 4000.5, 20.0),)}, "outside the photograph of 4000 x 3000"),
        ({"marks": (Mark("A", "DJI_0001", -0.5, 20.0),)}, "outside the photograph"),
        ({"marks": (Mark("A", "DJI_0001", 1, 2), Mark("A", "dji_0001.jpg", 9, 2))}, "marked twice"),
        ({"marks": (Mark("A", "other.jpg", 1, 2),)}, "No mark of gcps matches"),
        ({"coordinates": PLACES * [1, 1, np.nan]}, "no complete coordinates"),
        ({"coordinates": np.array([[3.0, 45.0, 1.0], [3.001, 45.0, 1.0], [3.0, 45.001, 1.0]])}, "look like degrees"),
        ({"crs": "EPSG:4326"}, "are no degrees"),
        (
            {"crs": 'LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],UNIT["metre",1]]'},
            "gcps is in the local system",
        ),
        ({"crs": "EPSG:4978"}, "which is geocentric: give longitude, latitude and height"),
        ({"crs": "EPSG:32631+5706"}, "has depths"),
        (
            {"coordinates": PLACES * 1000.0},
            "are too large for metres of WGS 84 / UTM zone 31N, as if in millimetres: give metres",
        ),
        (
            {"sigmas": np.array([[0.01, 0.02], [0.1, -0.1], [0.1, 0.1]])},
            "sigma of B in gcps is not above 0: give metres, or leave",
        ),
        ({"sigmas": np.array([[0.01, 0.02], [0.1, np.inf], [0.1, 0.1]])}, "sigma of B"),
        ({"roles": ("Contrôle", "", "")}, "'Contrôle' in gcps can mean control as well as check: write control or check"),
        ({"roles": ("CP", "", "")}, "'CP' in gcps can mean control as well as check"),
        ({"roles": ("v", "", "")}, "'v' in gcps is not known: write control or check"),
        ({"check": "B, Y, Z"}, "The check points 'Y', 'Z' of CHECK are not in gcps: correct CHECK; the points are A, B, C"),
        ({"crs": "EPSG:2263"}, "does not declare the unit of its heights"),
    ],
)
def test_unsound_control_is_one_sentence(changes, why):
    with pytest.raises(InputError, match=why) as told:
        control(**changes)
    assert str(told.value).count(". ") == 0


def test_check_points_by_name_and_identical_marks():
    twice = (Mark("A", "DJI_0001", 1, 2), Mark("A", "dji_0001.jpg", 1, 2))
    found = control(check="b, C", roles=("check", "", "control"), marks=twice)
    assert [p.check for p in found.points] == [True, True, True]
    assert len(found.points[0].marks) == 1


def test_roles_in_several_spellings_and_languages():
    checks = ("Check", "CHECK-POINT", "check_point", "ICP", "Point de vérification", "Kontrollpunkt")
    controls = ("", "Control", "GCP", " control point ", "Point d'appui", "Paßpunkt")
    names = tuple(map(str, range(12)))
    found = control(names=names, coordinates=np.tile(PLACES, (4, 1)), roles=checks + controls)
    assert [p.check for p in found.points] == [True] * 6 + [False] * 6


@pytest.mark.parametrize(
    ("wanted", "names", "found"),
    [
        (["a 1", "B"], ["A 1", "b"], {"a 1": "A 1", "B": "b"}),
        (["P1"], ["P01", "P02"], {"P1": "P01"}),
        (["gcp_7", "GCP-08"], ["GCP 7", "gcp8"], {"gcp_7": "GCP 7", "GCP-08": "gcp8"}),
        (["P1"], ["P01", "P001"], {}),  # two come near
        (["P01", "P1"], ["P01"], {"P01": "P01"}),  # P1 is another, for P01 is named
        (["P1", "P-1"], ["P01"], {}),  # two are meant
        (["P1-12"], ["P11-2"], {}),  # the digits of two numbers stay apart
        (["1.05"], ["1.5"], {"1.05": "1.5"}),
        (["10"], ["1", "01"], {}),
        (["-"], ["_"], {}),
    ],
)
def test_names_match_forgivingly_where_only_one_can_be_meant(wanted, names, found):
    assert match_names(wanted, names) == found


def test_what_matches_by_a_similar_name_is_told():
    found = control(
        names=("P01", "P02", "P03"), marks=(Mark("p-1", "DJI_0001", 1, 2), Mark("P02", "DJI_0001", 5, 6)), check="p 2;P3"
    )
    assert [len(p.marks) for p in found.points] == [1, 1, 0]
    assert [p.check for p in found.points] == [False, True, True]
    assert found.notes == ("Marks were matched by similar names: p-1 for P01.",)


def test_nothing_that_matches_lists_both_sides():
    with pytest.raises(
        InputError, match=r"the marks name the points X, Y in a\.jpg, the points are A, B, C, the photographs DJI_0001"
    ):
        control(marks=(Mark("X", "a.jpg", 1, 2), Mark("Y", "a.jpg", 1, 2)))


def test_zero_heights_are_called_out():
    one = PLACES.copy()
    one[1, 2] = 0.0
    assert "B of gcps has height 0 unlike the others" in " ".join(control(coordinates=one).notes)
    assert "All heights of gcps are 0" in " ".join(control(coordinates=PLACES * [1, 1, 0]).notes)
    assert control().notes == ()


def test_two_targets_marked_at_one_place():
    found = control(marks=(Mark("A", "DJI_0001", 10, 20), Mark("B", "DJI_0001", 11, 20), Mark("C", "DJI_0001", 15, 20)))
    assert [n for n in found.notes if "same place" in n] == [
        "A and B are marked at the same place in DJI_0001.JPG: one of the two is wrong."
    ]


def test_declared_feet_become_metres_in_plan_and_height():
    # New York Long Island in US survey feet with NAVD 88 heights in the same; the same points in metres of the same grid.
    feet = np.array([[984250.0, 196850.0, 100.0], [984350.0, 196850.0, 0.0], [984250.0, 196950.0, 50.0]])
    moved = in_metres(given(crs="EPSG:2263+6360", coordinates=feet), "EPSG:32118")
    assert moved == pytest.approx(feet * 1200 / 3937, abs=1e-4)


def test_degrees_with_heights_in_metres_are_moved():
    to_degrees = Transformer.from_crs(UTM, "EPSG:4326", always_xy=True)
    degrees = np.column_stack([*to_degrees.transform(PLACES[:, 0], PLACES[:, 1]), PLACES[:, 2]])
    assert in_metres(given(crs="EPSG:4326", coordinates=degrees), UTM) == pytest.approx(PLACES, abs=1e-4)
    assert in_metres(given(crs="EPSG:4979", coordinates=degrees), UTM) == pytest.approx(PLACES, abs=1e-4)


def test_predictions_that_nobody_measured_are_told():
    def table(score):
        fields = {n: np.array(v, object) for n, v in {"gcp": ["A", "B"], "image": ["a", "b"], "Score": score}.items()}
        return Layer("marks", np.arange(2), fields, None, None)

    (note,) = predictions_among(table([0.9, None]))
    assert "1 of 2 marks of marks have no score" in note
    assert predictions_among(table([0.9, 0.8])) == []
    assert predictions_among(Layer("marks", np.arange(2), {"gcp": np.array(["A", "B"], object)}, None, None)) == []
