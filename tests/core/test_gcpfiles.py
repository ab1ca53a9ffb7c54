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
        ("name,x,y,z\nP,1,2,3\n", "names no CRS"),
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


BOMB = '<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;">]><document>&b;</document>'


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (BOMB, "document type"),
        ("<document><chunk>", "not sound XML"),
        ("<kml/>", "not Metashape's"),
        ("<document><chunk><markers/></chunk></document>", "no markers with coordinates"),
        (METASHAPE.replace('z="3.5"', 'z="high"'), "not a number"),
        ("<Global><DicoAppuisFlottant><OneAppuisDAF/></DicoAppuisFlottant></Global>", "MicMac's"),
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
