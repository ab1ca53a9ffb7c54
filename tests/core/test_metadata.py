"""EXIF and XMP, written here and read back, and those of real photographs."""

import io

import numpy as np
import pytest
from PIL import Image
from PIL.PngImagePlugin import PngInfo
from PIL.TiffImagePlugin import IFDRational
from strandline.core.photographs.metadata import camera_name, focal_pixels, read_metadata
from strandline.core.photographs.xmp import DJI, parse_xmp, xmp_number

EXIF, GPS = 0x8769, 0x8825


def photograph(base=None, detail=None, gps=None, xmp=None, kind="JPEG"):
    exif = Image.Exif()
    exif[0x0131] = "test"  # Pillow writes no EXIF without a tag in its first directory
    for tag, value in (base or {}).items():
        exif[tag] = value
    exif.get_ifd(EXIF).update(detail or {})
    exif.get_ifd(GPS).update(gps or {})
    stream = io.BytesIO()
    more = {}
    if xmp and kind == "PNG":
        more["pnginfo"] = PngInfo()
        more["pnginfo"].add_itxt("XML:com.adobe.xmp", xmp.decode())
    elif xmp and kind == "TIFF":
        exif[700] = xmp
    elif xmp:
        more["xmp"] = xmp
    # The TIFF writer sees the directories of EXIF and GNSS only in bytes.
    Image.fromarray(np.zeros((8, 12, 3), np.uint8)).save(stream, kind, exif=exif.tobytes() if kind == "TIFF" else exif, **more)
    return stream.getvalue()


def packet(attributes="", elements=""):
    return (
        '<?xpacket begin="\ufeff" id="W5M0MpCehiHzreSzNTczkc9d"?><x:xmpmeta xmlns:x="adobe:ns:meta/">'
        '<rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="DJI" '
        f'xmlns:drone-dji="{DJI}" {attributes}>{elements}</rdf:Description></rdf:RDF></x:xmpmeta><?xpacket end="w"?>'
    ).encode()


PLACE = {1: "S", 2: (36.0, 30.0, 36.0), 3: "W", 4: (5.0, 15.0, 18.0)}


def test_position_and_height():
    told = read_metadata(photograph(gps={**PLACE, 5: b"\x00", 6: 12.5, 31: 0.75}))
    assert told.position.longitude == pytest.approx(-(5 + 15 / 60 + 18 / 3600), abs=1e-12)
    assert told.position.latitude == pytest.approx(-(36 + 30 / 60 + 36 / 3600), abs=1e-12)
    assert (told.position.height, told.position.sigma_h, told.position.sigma_v) == (12.5, 0.75, None)


@pytest.mark.parametrize(("reference", "sign"), [(b"\x00", 1), (b"\x01", -1), (b"\x02", 1), (b"\x03", -1)])
def test_height_below_the_reference(reference, sign):
    assert read_metadata(photograph(gps={**PLACE, 5: reference, 6: 3.25})).position.height == sign * 3.25


def test_a_receiver_without_a_fix_has_no_position():
    assert read_metadata(photograph(gps={1: "N", 2: (0.0, 0.0, 0.0), 3: "E", 4: (0.0, 0.0, 0.0), 6: 3.0})).position is None
    broken = {**PLACE, 2: (IFDRational(0, 0), IFDRational(0, 0), IFDRational(0, 0))}
    assert read_metadata(photograph(gps=broken)).position is None
    assert read_metadata(photograph(gps={1: "N", 2: (36.0, 0.0, 0.0)})).position is None


def test_no_metadata():
    told = read_metadata(photograph())
    assert (told.position, told.time, told.problems) == (None, None, ())
    assert focal_pixels(told, 4000, 3000) is None
    assert camera_name(told, 4000, 3000) == "unknown camera, 4000 x 3000"


def test_time_with_fraction_and_offset():
    detail = {0x9003: "2024:05:01 10:20:30", 0x9291: "07", 0x9011: "+10:00"}
    assert read_metadata(photograph(detail=detail)).time == "2024-05-01T10:20:30.07+10:00"
    assert read_metadata(photograph(detail={0x9004: "2024:05:01 10:20:30"})).time == "2024-05-01T10:20:30"
    assert read_metadata(photograph(detail={0x9003: "0000:00:00 00:00:00"})).time is None


def test_focal_length_from_the_pixel_pitch():
    # 25 mm behind 100 pixels per mm are 2500 pixels, 1250 in a photograph of half the size, upright or not.
    detail = {0x920A: 25.0, 0xA20E: 2540.0, 0xA210: 2, 0xA002: 4000, 0xA003: 3000}
    told = read_metadata(photograph(detail=detail))
    assert focal_pixels(told, 4000, 3000) == pytest.approx(2500.0)
    assert focal_pixels(told, 2000, 1500) == pytest.approx(1250.0)
    assert focal_pixels(told, 1500, 2000) == pytest.approx(1250.0)
    assert focal_pixels(read_metadata(photograph(detail={**detail, 0xA20E: 1000.0, 0xA210: 3})), 4000, 3000) == pytest.approx(
        2500.0
    )


def test_focal_length_from_the_35_mm_equivalent():
    # Diagonals: 43.267 mm of film; 5000 px of 4:3; 4000 x 2250 is cut from 4:3.
    told = read_metadata(photograph(detail={0xA405: 24}))
    assert focal_pixels(told, 4000, 3000) == pytest.approx(24 * 5000 / 43.2666, rel=1e-5)
    assert focal_pixels(told, 3000, 4000) == pytest.approx(24 * 5000 / 43.2666, rel=1e-5)
    assert focal_pixels(told, 4000, 2250) == pytest.approx(24 * 5000 / 43.2666, rel=1e-5)
    assert focal_pixels(told, 6000, 4000) == pytest.approx(4000.0, rel=1e-5)  # 24 of 36 mm


def test_a_pixel_pitch_that_contradicts_is_not_used():
    detail = {0x920A: 25.0, 0xA20E: 72.0, 0xA210: 2, 0xA002: 4000}
    assert focal_pixels(read_metadata(photograph(detail=detail)), 4000, 3000) is None  # a sensor of 1.4 m
    told = read_metadata(photograph(detail={**detail, 0xA20E: 2540.0, 0xA405: 50}))
    assert focal_pixels(told, 4000, 3000) == pytest.approx(50 * 5000 / 43.2666, rel=1e-5)


def test_the_name_of_a_camera():
    base = {0x010F: "Canon\0\0", 0x0110: "Canon EOS R"}
    assert camera_name(read_metadata(photograph(base, {0x920A: 30.0})), 6, 4) == "Canon EOS R, 30 mm, 6 x 4"
    base = {0x010F: "DJI", 0x0110: "FC6310"}
    told = read_metadata(photograph(base, {0xA434: "8.8-24mm", 0xA431: "0K8T"}))
    assert camera_name(told, 6, 4) == "DJI FC6310, 8.8-24mm, no. 0K8T, 6 x 4"


ATTRIBUTES = (
    'drone-dji:AbsoluteAltitude="+58.25" drone-dji:RelativeAltitude="+40.10" drone-dji:GimbalYawDegree="-132.00" '
    'drone-dji:GimbalPitchDegree="-89.90" drone-dji:GimbalRollDegree="+0.00"'
)
RTK = (
    'drone-dji:RtkFlag="50" drone-dji:RtkStdLon="0.03" drone-dji:RtkStdLat="0.01" drone-dji:RtkStdHgt="0.025" '
    'drone-dji:GpsLatitude="-36.51000001" drone-dji:GpsLongtitude="-5.25500001"'
)


@pytest.mark.parametrize("kind", ["JPEG", "PNG", "TIFF"])
@pytest.mark.parametrize("as_elements", [False, True])
def test_xmp_of_a_drone(kind, as_elements):
    elements = "".join(
        f"<{key}>{value}</{key}>" for key, value in (pair.rstrip('"').split('="') for pair in ATTRIBUTES.split('" ') if pair)
    )
    data = packet("", elements) if as_elements else packet(ATTRIBUTES)
    told = read_metadata(photograph(gps={**PLACE, 6: 58.5}, xmp=data, kind=kind))
    assert (told.relative_height, told.yaw, told.pitch, told.roll) == (40.1, -132.0, -89.9, 0.0)
    # Without RTK, EXIF's height is used, and the difference can be told.
    assert (told.position.height, told.exif_height, told.xmp_height) == (58.5, 58.5, 58.25)
    assert told.position.sigma_h is None


def test_xmp_of_an_rtk_drone():
    told = read_metadata(photograph(gps={**PLACE, 6: 58.5, 31: 2.0}, xmp=packet(ATTRIBUTES + " " + RTK)))
    assert told.position.longitude == -5.25500001
    assert told.position.latitude == -36.51000001
    assert told.position.height == 58.25
    assert told.position.sigma_h == pytest.approx(((0.03**2 + 0.01**2) / 2) ** 0.5)
    assert told.position.sigma_v == 0.025


def test_xmp_alone_can_tell_the_place():
    told = read_metadata(photograph(xmp=packet(ATTRIBUTES + ' drone-dji:GpsLatitude="10.5" drone-dji:GpsLongitude="20.5"')))
    assert (told.position.longitude, told.position.latitude, told.position.height) == (20.5, 10.5, 58.25)


def test_hostile_and_broken_xmp_is_reported():
    bomb = b'<!DOCTYPE a [<!ENTITY e SYSTEM "file:///etc/passwd">]><a>&e;</a>'
    with pytest.raises(ValueError, match="document type"):
        parse_xmp(bomb)
    told = read_metadata(photograph(gps={**PLACE, 6: 1.0}, xmp=b"<x:xmpmeta><broken"))
    assert told.position is not None
    assert "XMP" in told.problems[0]


def test_numbers_of_xmp():
    found = parse_xmp(packet('drone-dji:A="+1.50" drone-dji:B="NaN" drone-dji:C="x"'))
    assert xmp_number(found, DJI, "A") == 1.5
    assert xmp_number(found, DJI, "B", "C", "D") is None
    assert xmp_number(found, DJI, "B", "A") == 1.5


def test_broken_exif_is_reported_not_fatal():
    data = bytearray(photograph({0x010F: "DJI"}, {0x920A: 25.0}, PLACE))
    start = data.index(b"Exif\0\0") + 6
    data[start + 4 : start + 8] = b"\xff\xff\xff\x7f"  # the first directory lies beyond the end
    told = read_metadata(bytes(data))
    assert told.position is None
    assert "EXIF is broken" in told.problems[0]


def test_a_dji_photograph(shared_data):
    told = read_metadata((shared_data / "brighton/images/DJI_0026.JPG").read_bytes())
    assert told.position.longitude == pytest.approx(-91.99395439, abs=1e-8)
    assert told.position.latitude == pytest.approx(46.84269025, abs=1e-8)
    assert told.position.height == 198.609
    assert (told.relative_height, told.yaw, told.pitch) == (40.1, -132.0, -89.9)
    assert told.time == "2016-06-23T16:32:57"
    # Its block adjustment finds 2330 px or so; 20 mm is rounded to 2.5 %.
    assert focal_pixels(told, 4000, 2250) == pytest.approx(2330, rel=0.025)


def test_a_canon_photograph(shared_data):
    told = read_metadata((shared_data / "copr/images/IMG_0022.jpg").read_bytes())
    assert told.time == "2009-09-02T07:38:43.89"
    assert focal_pixels(told, 4272, 2848) == pytest.approx(30 / 22.2 * 4272, rel=0.01)  # its sensor is 22.2 mm wide


def test_a_raw_file_built_like_a_tiff(shared_data):
    told = read_metadata((shared_data / "raw/colorchart.dng").read_bytes())
    assert told.body == "Canon EOS Kiss X4"
