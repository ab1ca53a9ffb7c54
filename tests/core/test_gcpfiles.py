"""Files of ground control: ODM's list and Metashape's XML, sound and unsound."""

import numpy as np
import pytest
from strandline.core.errors import InputError
from strandline.core.orientation.control import control_from
from strandline.core.orientation.gcpfiles import read_gcp_file
from strandline.core.orientation.marks import Mark
from strandline.core.survey import Photograph

ODM = """EPSG:32611

# a comment
10.5 20.25 3 99.5 199.5 a.jpg P1
10.5 20.25 3 0 0 b.jpg P1 and more
11 21 4 1e2 2e2 a.jpg P2
"""

METASHAPE = """<?xml version="1.0" encoding="UTF-8"?>
<document version="1.2.0"><chunk label="beach" enabled="true">
 <cameras next_id="2"><camera id="0" label="DJI_0001"/><group id="0"><camera id="7" label="DJI_0002.JPG"/></group></cameras>
 <markers next_id="4">
  <marker id="1" label="A"><reference x="500000.5" y="4983000.25" z="3.5" sx="0.01" sy="0.01" sz="0.03" enabled="true"/></marker>
  <marker id="2" label="B"><reference x="500010" y="4983000" z="4" enabled="false"/></marker>
  <marker id="3" label="tie"/>
 </markers>
 <frames next_id="1"><frame id="0"><markers>
  <marker marker_id="1"><location camera_id="0" pinned="true" x="10.5" y="20.5"/>
   <location camera_id="7" pinned="false" x="1" y="2"/></marker>
  <marker marker_id="2"><location camera_id="7" pinned="true" x="30" y="40"/></marker>
  <marker marker_id="3"><location camera_id="7" pinned="true" x="3" y="4"/></marker>
 </markers></frame></frames>
 <reference>EPSG:32631</reference>
</chunk></document>
"""


def read(tmp_path, text, name="gcp_list.txt", encoding="utf-8"):
    path = tmp_path / name
    path.write_bytes(text.encode(encoding))
    return read_gcp_file(str(path))


def test_odm_counts_from_the_centre_of_the_pixel(tmp_path):
    given = read(tmp_path, ODM)
    assert given.crs == "EPSG:32611"
    assert given.names == ("P1", "P2")
    assert given.coordinates.tolist() == [[10.5, 20.25, 3.0], [11.0, 21.0, 4.0]]
    assert given.marks == (Mark("P1", "a.jpg", 100.0, 200.0), Mark("P1", "b.jpg", 0.5, 0.5), Mark("P2", "a.jpg", 100.5, 200.5))


def test_odm_without_names_groups_by_coordinates(tmp_path):
    given = read(tmp_path, "EPSG:32611\n1 2 3 4 5 a.jpg\n1 2 3 6 7 b.jpg\n9 2 3 4 5 a.jpg\n")
    assert given.names == ("gcp1", "gcp2")
    assert [m.gcp for m in given.marks] == ["gcp1", "gcp1", "gcp2"]


def test_odm_with_tabs_keeps_blanks_in_names(tmp_path):
    given = read(tmp_path, "EPSG:32611\r\n1\t2\t3\t4\t5\tmy photo.jpg\tgcp 1\tx\r\n")
    assert given.marks == (Mark("gcp 1", "my photo.jpg", 4.5, 5.5),)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16", "cp1252"])
def test_encodings(tmp_path, encoding):
    given = read(tmp_path, "WGS84 UTM 31N\n1 2 3 4 5 a.jpg Été\n", encoding=encoding)
    assert given.names == ("Été",)
    assert given.crs == "EPSG:32631"


@pytest.mark.parametrize(
    ("line", "crs"),
    [
        ("WGS84 UTM 7S", "EPSG:32707"),
        ("wgs84 utm 60 n", "EPSG:32660"),
        ("epsg:2154", "EPSG:2154"),
        ("+proj=utm +zone=11 +datum=WGS84", "EPSG:32611"),
        ("EPSG:2263+6360", "EPSG:2263+6360"),
    ],
)
def test_odm_crs(tmp_path, line, crs):
    assert read(tmp_path, f"{line}\n1 2 3 4 5 a.jpg P\n").crs == crs


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("", "is empty"),
        ("EPSG:32611\n", "no points"),
        ("WGS84 UTM 61N\n1 2 3 4 5 a.jpg\n", "names no CRS"),
        ("P 1 2 3\n", "names no CRS"),
        ("EPSG:32611\n1 2 3 4 a.jpg P\n", "line 2"),
        ("EPSG:32611\n1 2 3 4 5\n", "line 2"),
        ("EPSG:32611\n1 2 3 nan 5 a.jpg P\n", "no finite pixel"),
        ("EPSG:32611\n1 2 3 4 5 a.jpg P\n1 2 9 4 5 b.jpg P\n", "other coordinates"),
    ],
)
def test_unsound_lists_are_one_sentence(tmp_path, text, why):
    with pytest.raises(InputError, match=why):
        read(tmp_path, text)


def test_a_missing_file(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_gcp_file(str(tmp_path / "none.txt"))


def test_metashape_takes_what_was_measured(tmp_path):
    given = read(tmp_path, METASHAPE, "markers.xml")
    assert given.crs == "EPSG:32631"
    assert given.names == ("A", "B")
    assert given.roles == ("control", "check")
    assert given.coordinates[0].tolist() == [500000.5, 4983000.25, 3.5]
    assert given.sigmas[0].tolist() == [0.01, 0.03]
    assert np.isnan(given.sigmas[1]).all()
    # Its pixels count from the corner, as ours; projections that nobody pinned and markers without coordinates stay out.
    assert given.marks == (Mark("A", "DJI_0001", 10.5, 20.5), Mark("B", "DJI_0002.JPG", 30.0, 40.0))


def test_metashapes_chunk_with_ground_points_is_the_one_that_counts(tmp_path):
    two = METASHAPE.replace("<chunk label", '<chunk label="other"><markers/></chunk><chunk label', 1)
    given = read(tmp_path, two.replace('sx="0.01" sy="0.01"', 'sx="0.03" sy="0.04"'), "markers.xml")
    assert given.names == ("A", "B")
    assert given.sigmas[0] == pytest.approx([np.sqrt((0.03**2 + 0.04**2) / 2), 0.03])


BOMB = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">]><document>&b;</document>'


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (BOMB, "document type"),
        ("<document><chunk>", "not sound XML"),
        ("<kml/>", "neither Metashape"),
        ("<document><chunk><markers/></chunk></document>", "no markers with coordinates"),
        (METASHAPE.replace('z="3.5"', 'z="high"'), "not a number"),
        ("<html><chunk/></html>", "neither Metashape"),
        (METASHAPE.replace("</document>", METASHAPE[METASHAPE.index("<chunk") :]), r"has 2 chunks with ground points \('beach'"),
        ("<Global><DicoAppuisFlottant><OneAppuisDAF/></DicoAppuisFlottant></Global>", "has no NamePt"),
    ],
)
def test_unsound_xml_is_one_sentence(tmp_path, text, why):
    with pytest.raises(InputError, match=why):
        read(tmp_path, text, "markers.xml")


def test_an_entity_bomb_in_another_encoding_is_seen(tmp_path):
    with pytest.raises(InputError, match="document type"):
        read(tmp_path, BOMB, "markers.xml", "utf-16")


def test_the_list_of_a_real_flight(shared_data):
    given = read_gcp_file(str(shared_data / "copr" / "gcp_list.txt"))
    assert given.names == ("gcp02", "gcp04", "gcp09", "gcp08", "gcp07", "gcp05", "gcp03", "gcp01", "gcp00", "gcp06")
    assert len(given.marks) == 27
    assert given.marks[14] == Mark("gcp07", "IMG_0082.jpg", 1640.0463944989856 + 0.5, 688.9350706858276 + 0.5)
    names = sorted(p.name for p in (shared_data / "copr" / "images").iterdir())
    photographs = [Photograph(n, 1, "x", 4272, 2848, "c") for n in names]
    control = control_from(given, "EPSG:32611", photographs, sigma_h=3.0, sigma_v=5.0)
    assert sum(len(p.marks) for p in control.points) == 23
    assert [p.name for p in control.points if len(p.marks) < 2] == ["gcp00", "gcp06"]
    notes = " ".join(control.notes)
    assert "All heights of gcp_list.txt are 0" in notes
    assert "IMG_0121.jpg, IMG_0100.jpg, IMG_0109.jpg, IMG_0112.jpg" in notes
    # The clicks of two targets 16 m apart lie 0.8 pixels from each other.
    assert "gcp04 and gcp00 are marked at the same place in IMG_0031.jpg" in notes


# MicMac

POINTS_XML = """<?xml version="1.0" ?>
<Global><DicoAppuisFlottant>
 <OneAppuisDAF><Pt> 500000.5 4983000.25 3.5 </Pt><NamePt>A</NamePt><Incertitude>0.03 0.04 0.05</Incertitude></OneAppuisDAF>
 <OneAppuisDAF><Pt>500010 4983000 4e0</Pt><NamePt> B </NamePt><Incertitude>-1 -1 -1</Incertitude></OneAppuisDAF>
</DicoAppuisFlottant></Global>
"""
MARKS_XML = """<?xml version="1.0" ?>
<SetOfMesureAppuisFlottants>
 <MesureAppuiFlottant1Im><NameIm>DJI_0001.JPG</NameIm>
  <OneMesureAF1I><NamePt>A</NamePt><PtIm>10.5 20.5</PtIm></OneMesureAF1I>
  <OneMesureAF1I><NamePt>B</NamePt><PtIm> 30 40.25 </PtIm></OneMesureAF1I></MesureAppuiFlottant1Im>
 <MesureAppuiFlottant1Im><NameIm>DJI_0002.JPG</NameIm></MesureAppuiFlottant1Im>
</SetOfMesureAppuisFlottants>
"""
POINTS_TEXT = "#F=N X Y Z Ix Iy Iz\n# a comment\nA 500000.5 4983000.25 3.5 0.03 0.04 0.05\n\nB 500010 4983000 4 1 1 2\n"
# What SaisieAppuis*QT measures counts from the corner, as the window draws the image from 0 to its width.
MARKS = (Mark("A", "DJI_0001.JPG", 10.5, 20.5), Mark("B", "DJI_0001.JPG", 30.0, 40.25))


def folder(tmp_path, **files):
    for name, text in files.items():
        (tmp_path / name.replace("_", ".")).write_text(text, encoding="utf-8")
    return lambda *names: read_gcp_file(";".join(str(tmp_path / n) for n in names))


@pytest.mark.parametrize("given", [("p.xml",), ("m.xml",), ("p.xml", "m.xml"), ("m.xml", "p.xml")])
def test_micmacs_two_files_find_each_other(tmp_path, given):
    read_files = folder(tmp_path, p_xml=POINTS_XML, m_xml=MARKS_XML, other_xml="<a/>", broken_xml="<a>", list_txt=ODM)
    found = read_files(*given)
    assert found.names == ("A", "B")
    assert found.coordinates.tolist() == [[500000.5, 4983000.25, 3.5], [500010.0, 4983000.0, 4.0]]
    assert found.marks == MARKS
    assert found.crs is None
    assert found.borrows_crs
    # The root mean square of 3 and 4 cm per axis; what is below 0 says nothing.
    assert found.sigmas[0] == pytest.approx([np.sqrt((0.03**2 + 0.04**2) / 2), 0.05])
    assert np.isnan(found.sigmas[1]).all()
    missing = {
        "p.xml": "p.xml holds points only: the marks are those of m.xml",
        "m.xml": "m.xml holds marks only: the points are",
    }
    assert [missing[given[0]] in n for n in found.notes] == ([True] if len(given) == 1 else [])


def test_micmacs_text_of_points(tmp_path):
    found = folder(tmp_path, p_txt=POINTS_TEXT, m_xml=MARKS_XML)("p.txt")
    assert found.coordinates.tolist() == [[500000.5, 4983000.25, 3.5], [500010.0, 4983000.0, 4.0]]
    assert found.sigmas[1].tolist() == [1.0, 2.0]
    swapped = folder(tmp_path, p_txt="#F= X Y N S Z\n1 2 B junk 3\n1 2 A junk 4\n")("p.txt", "m.xml")
    assert swapped.names == ("B", "A")
    assert swapped.coordinates[0].tolist() == [1.0, 2.0, 3.0]


def test_points_as_text_and_as_the_xml_made_of_it_are_one_file(tmp_path):
    ones = POINTS_XML.replace("0.03 0.04 0.05", "1 1 1").replace("-1 -1 -1", "1 1 1")
    estimated = POINTS_XML.replace("3.5", "3.6")  # what MicMac intersected itself is no survey
    found = folder(tmp_path, GCPs_txt=POINTS_TEXT, GCPs_xml=ones, m_xml=MARKS_XML)
    (tmp_path / "Final-S3D.xml").write_text(estimated, encoding="utf-8")
    assert found("m.xml").coordinates[0, 2] == 3.5


def test_incertitude_of_one_says_nothing(tmp_path):
    ones = POINTS_XML.replace("0.03 0.04 0.05", "1 1 1").replace("-1 -1 -1", "1 1 1")
    found = folder(tmp_path, p_xml=ones, m_xml=MARKS_XML)("p.xml")
    assert np.isnan(found.sigmas).all()
    assert "Incertitude is 1 1 1 for all points of p.xml" in found.notes[0]


def test_micmac_takes_the_surveys_crs_and_says_so(tmp_path):
    given = folder(tmp_path, p_xml=POINTS_XML, m_xml=MARKS_XML)("p.xml").in_crs_of("EPSG:32631")
    photographs = [Photograph("DJI_0001.JPG", 1, "x", 4000, 3000, "c")]
    control = control_from(given, "EPSG:32631", photographs, sigma_h=0.01, sigma_v=0.02)
    assert control.points[0].coordinates.tolist() == [500000.5, 4983000.25, 3.5]
    assert control.points[0].marks == (Mark("A", "DJI_0001.JPG", 10.5, 20.5),)
    assert "p.xml names no CRS: its coordinates are taken as those of WGS 84 / UTM zone 31N." in control.notes


@pytest.mark.parametrize(
    ("files", "given", "why"),
    [
        ({"p_xml": POINTS_XML}, ["p.xml"], "p.xml holds points only, and its folder has no file of marks with the same names"),
        ({"m_xml": MARKS_XML}, ["m.xml"], "m.xml holds marks only, and its folder has no file of points"),
        (
            {"p_xml": POINTS_XML, "m_xml": MARKS_XML, "n_xml": MARKS_XML.replace("10.5", "11")},
            ["p.xml"],
            "could be those of m.xml or n.xml",
        ),
        ({"p_xml": POINTS_XML, "m_xml": MARKS_XML.replace(">A<", ">C<").replace(">B<", ">D<")}, ["p.xml"], "no file of marks"),
        ({"p_xml": POINTS_XML}, ["p.xml", "p.xml"], "both hold points"),
        ({"p_xml": POINTS_XML, "l_txt": ODM}, ["p.xml", "l.txt"], "l.txt holds points and marks: give it alone"),
        ({"p_xml": POINTS_XML}, ["p.xml"] * 3, "names 3 files"),
        ({"p_xml": POINTS_XML.replace("4983000.25 3.5", "4983000.25")}, ["p.xml"], "Pt of A in p.xml is not 3 numbers"),
        ({"p_xml": POINTS_XML.replace("3.5", "nan")}, ["p.xml"], "Pt of A in p.xml is not 3 numbers"),
        ({"p_xml": POINTS_XML.replace("0.03 0.04", "0.03")}, ["p.xml"], "Incertitude of A in p.xml is not 3 numbers"),
        ({"p_xml": "<DicoAppuisFlottant></DicoAppuisFlottant>"}, ["p.xml"], "p.xml has no ground points"),
        ({"m_xml": "<SetOfMesureAppuisFlottants/>"}, ["m.xml"], "m.xml has no image measures"),
        ({"m_xml": MARKS_XML.replace("<NameIm>DJI_0001.JPG</NameIm>", "")}, ["m.xml"], "has no NameIm or no NamePt"),
        ({"m_xml": MARKS_XML[:200]}, ["m.xml"], "not sound XML"),
        ({"p_txt": "#F=N X Y\nA 1 2\n"}, ["p.txt"], "does not place N, X, Y and Z"),
        ({"p_txt": "#F=N X Y Z\nA 1 2\n"}, ["p.txt"], "The line 2 of p.txt has not the columns N X Y Z"),
        ({"p_txt": "#F=N X Y Z\nA 1 2 high\n"}, ["p.txt"], "The line 2 in p.txt is not 3 numbers"),
    ],
)
def test_unsound_pairs_are_one_sentence(tmp_path, files, given, why):
    with pytest.raises(InputError, match=why) as told:
        folder(tmp_path, **files)(*given)
    assert str(told.value).count(". ") == 0


# Tables

REFERENCE = """# CoordinateSystem: PROJCS["WGS 84 / UTM zone 31N",GEOGCS["WGS 84",DATUM["World Geodetic System 1984",\
SPHEROID["WGS 84",6378137,298.257223563]],PRIMEM["Greenwich",0],UNIT["degree",0.0174532925199433]],\
PROJECTION["Transverse_Mercator"],PARAMETER["latitude_of_origin",0],PARAMETER["central_meridian",3],\
PARAMETER["scale_factor",0.9996],PARAMETER["false_easting",500000],PARAMETER["false_northing",0],UNIT["metre",1]]
#Label,X/East,Y/North,Z/Altitude,Accuracy_X/Y_(m),Accuracy_Z_(m),Error_(m),X_error,Y_error,Z_error,X_est,Y_est,Z_est,Enable
A,500000.5,4983000.25,3.5,0.01,0.03,0.02,0.01,0.01,0.01,500000.51,4983000.26,3.51,1
B,500010,4983000,4,,,,,,,,,,0
tie,,,,,,,,,,1,2,3,1
# Total Error,,,,,,0.02
"""


def test_metashapes_reference_beside_a_table_of_marks(tmp_path):
    marks = "image_name,gcp_name,image_u,image_v\nDJI_0001.JPG,A,10.5,20.5\nDJI_0001.JPG,B,30,40.25\n"
    found = folder(tmp_path, reference_csv=REFERENCE, marks_csv=marks)("reference.csv")
    assert found.names == ("A", "B")
    assert found.coordinates.tolist() == [[500000.5, 4983000.25, 3.5], [500010.0, 4983000.0, 4.0]]
    assert found.roles == ("", "check")
    assert found.sigmas[0].tolist() == [0.01, 0.03]
    assert np.isnan(found.sigmas[1]).all()
    assert found.marks == MARKS
    assert found.crs.startswith("PROJCS")
    assert not found.borrows_crs
    control = control_from(found, "EPSG:32631", [Photograph("DJI_0001.JPG", 1, "x", 4000, 3000, "c")], sigma_h=1, sigma_v=2)
    assert [p.check for p in control.points] == [False, True]
    assert control.points[0].coordinates == pytest.approx([500000.5, 4983000.25, 3.5], abs=1e-6)


@pytest.mark.parametrize(
    "marks",
    [
        "DJI_0001.JPG,A,10.5,20.5,1.2\nDJI_0001.JPG,B,30,40.25,0.7\n",  # Pix4D's
        "A,DJI_0001.JPG,10.5,20.5\nB,DJI_0001.JPG,30,40.25\n",
        "Marker label,Camera label,Pixel X,Pixel Y\nA,DJI_0001.JPG,10.5,20.5\nB,DJI_0001.JPG,30,40.25\n",
        "gcp;image;x;y\nA;DJI_0001.JPG;10,5;20,5\nB;DJI_0001.JPG;30;40,25\n",
        "\ufeffX\tY\tGCP\tImage\r\n10.5\t20.5\tA\tDJI_0001.JPG\r\n30\t40.25\tB\tDJI_0001.JPG\r\n",
        'gcp,image,x,y\nA,"DJI_0001.JPG","10,5","20,5"\nB,DJI_0001.JPG,30,40.25\n',
    ],
)
def test_tables_of_marks_of_any_make(tmp_path, marks):
    points = "name;easting;northing;height;role\nA;500000,5;4983000,25;3,5;check\nB;500010;4983000;4;\n"
    found = folder(tmp_path, points_csv=points, marks_csv=marks)("points.csv")
    assert found.coordinates.tolist() == [[500000.5, 4983000.25, 3.5], [500010.0, 4983000.0, 4.0]]
    assert found.roles == ("check", "")
    assert found.marks == MARKS
    assert found.borrows_crs


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("name,x,y,z\n", "no points with coordinates below its header"),
        ("name,x,y,z\nA,1,2,high\n", "'high' in the line 2 of t.csv is not a number"),
        ("name,x,y,z\n,1,2,3\n", "The line 2 of t.csv names no point"),
        ("gcp,image,x,y\n", "no marks below its header"),
        ("gcp,image,x,y\nA,a.jpg,1\n", "The line 2 of t.csv is not complete"),
        ("gcp,image,x,y\nA,a.jpg,1.234.5,3\n", "'1.234.5' in the line 2"),
        ("spam,eggs\n1,2\n", "names no CRS"),
        ("name,x,y,z\nA,1,2,3\n", "holds points only"),
    ],
)
def test_unsound_tables_are_one_sentence(tmp_path, text, why):
    with pytest.raises(InputError, match=why) as told:
        folder(tmp_path, t_csv=text)("t.csv")
    assert str(told.value).count(". ") == 0


def test_what_is_no_text_or_too_large_is_refused(tmp_path, monkeypatch):
    (tmp_path / "p.xml").write_bytes(b"\x00\x01\x02\xff" * 100)
    with pytest.raises(InputError, match="is not text"):
        read_gcp_file(str(tmp_path / "p.xml"))
    with pytest.raises(InputError, match="is a folder"):
        read_gcp_file(str(tmp_path))
    monkeypatch.setattr("strandline.core.orientation.gcptext._MOST_BYTES", 10)
    with pytest.raises(InputError, match="far too large"):
        read_gcp_file(str(tmp_path / "p.xml"))


def test_an_entity_bomb_beside_the_file_is_passed_over(tmp_path):
    read_files = folder(tmp_path, p_xml=POINTS_XML, m_xml=MARKS_XML, bomb_xml=BOMB)
    assert read_files("p.xml").marks == MARKS
