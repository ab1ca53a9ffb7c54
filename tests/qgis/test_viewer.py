"""The photograph on the screen: what is clicked is what is marked, and its pixels are where they belong."""

import pytest
from marking_world import HEIGHT, WIDTH, make_photograph

AT = [0.37, 1.0, 2.5, 8.0]


@pytest.fixture
def shown(qgis, tmp_path):
    """Return a viewer of 500 x 400 with a photograph of 640 x 480, all of whose levels are there."""
    from strandline.provider.pixels import Source, opened, read_level
    from strandline.provider.viewer import Viewer

    path = tmp_path / "a.png"
    make_photograph(path)
    source = Source(path, WIDTH, HEIGHT)
    data = opened(source)
    viewer = Viewer()
    viewer.resize(500, 400)
    viewer.show_source(source, [read_level(data, factor, source) for factor in source.factors()])
    viewer.show()
    return viewer


def mouse():
    from qgis.PyQt.QtCore import QPoint, Qt
    from qgis.PyQt.QtTest import QTest

    return QTest, QPoint, Qt


def drag(viewer, start, end):
    from qgis.PyQt.QtCore import QEvent, QPointF
    from qgis.PyQt.QtGui import QMouseEvent
    from qgis.PyQt.QtWidgets import QApplication

    qtest, point, qt = mouse()
    left, none = qt.MouseButton.LeftButton, qt.KeyboardModifier.NoModifier
    qtest.mousePress(viewer, left, none, point(*start))
    for part in (0.1, 0.3, 0.7, 1.0):
        where = QPointF(*(round(a + part * (b - a)) for a, b in zip(start, end, strict=True)))
        # QTest.mouseMove moves the cursor, which a screen that is none does not report.
        globally = QPointF(viewer.mapToGlobal(where.toPoint()))
        event = QMouseEvent(QEvent.Type.MouseMove, where, globally, qt.MouseButton.NoButton, left, none)
        QApplication.sendEvent(viewer, event)
    qtest.mouseRelease(viewer, left, none, point(*end))


@pytest.mark.parametrize("scale", AT)
def test_a_click_marks_the_pixel_under_it(shown, scale):
    qtest, point, qt = mouse()
    found = []
    shown.marked.connect(lambda x, y: found.append((x, y)))
    shown.look_at(300.0, 200.0, scale)
    qtest.mouseClick(shown, qt.MouseButton.LeftButton, qt.KeyboardModifier.NoModifier, point(260, 170))
    # The middle of the screen's pixel (260, 170), in a window whose middle (250, 200) shows (300, 200).
    assert found == [(pytest.approx(300.0 + 10.5 / scale, abs=0.01), pytest.approx(200.0 - 29.5 / scale, abs=0.01))]


@pytest.mark.parametrize("scale", AT)
def test_what_is_drawn_under_the_cursor_is_the_pixel_that_is_marked(shown, scale):
    """The photograph's colours tell its coordinates to 4 pixels; what is grabbed from the screen must agree with the click."""
    qtest, point, qt = mouse()
    found = []
    shown.marked.connect(lambda x, y: found.append((x, y)))
    shown.look_at(333.0, 222.0, scale)
    screen = shown.grab().toImage()
    for place in ((200, 150), (250, 200), (300, 290)):
        qtest.mouseClick(shown, qt.MouseButton.LeftButton, qt.KeyboardModifier.NoModifier, point(*place))
        colour = screen.pixelColor(*place)
        x, y = found[-1]
        assert abs(4 * colour.red() + 2 - x) <= 2.01 + 1.0 / scale
        assert abs(4 * colour.green() + 2 - y) <= 2.01 + 1.0 / scale


def test_the_wheel_zooms_about_the_cursor(shown):
    from qgis.PyQt.QtCore import QPointF

    shown.look_at(300.0, 200.0, 1.0)
    cursor = QPointF(400.0, 90.0)
    before = shown.to_photograph(cursor)
    for notch in (1.25, 1.25, 0.8, 1.25, 1.25):
        shown.zoom(notch, cursor)
        after = shown.to_photograph(cursor)
        assert (after - before).manhattanLength() < 1e-6
    assert shown.scale == pytest.approx(1.25**3)


def test_real_wheel_events_zoom(shown):
    from qgis.PyQt.QtCore import QPoint, QPointF, Qt
    from qgis.PyQt.QtGui import QWheelEvent
    from qgis.PyQt.QtWidgets import QApplication

    shown.look_at(300.0, 200.0, 1.0)
    place = QPointF(100.0, 300.0)
    before = shown.to_photograph(place)
    event = QWheelEvent(
        place, place, QPoint(), QPoint(0, 240), Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier,
        Qt.ScrollPhase.NoScrollPhase, False,
    )  # fmt: skip
    QApplication.sendEvent(shown, event)
    assert shown.scale == pytest.approx(1.25**2)
    assert (shown.to_photograph(place) - before).manhattanLength() < 1e-6


@pytest.mark.parametrize("scale", AT)
def test_a_mark_is_dragged_by_as_much_as_the_cursor(shown, scale):
    from strandline.provider.viewer import Sign

    moved, marked = [], []
    shown.moved.connect(lambda x, y: moved.append((x, y)))
    shown.marked.connect(lambda x, y: marked.append((x, y)))
    shown.look_at(300.0, 200.0, scale)
    shown.set_signs([], Sign(301.3, 199.2, "#ffffff"))
    place = shown.to_widget(301.3, 199.2)
    start = (round(place.x()) + 3, round(place.y()) - 2)  # taken hold of beside its middle
    drag(shown, start, (start[0] + 24, start[1] - 15))
    assert marked == []
    assert moved == [(pytest.approx(301.3 + 24 / scale, abs=0.01), pytest.approx(199.2 - 15 / scale, abs=0.01))]


def test_a_drag_elsewhere_pans_and_marks_nothing(shown):
    from strandline.provider.viewer import Sign

    found = []
    shown.moved.connect(lambda x, y: found.append((x, y)))
    shown.marked.connect(lambda x, y: found.append((x, y)))
    shown.look_at(300.0, 200.0, 2.0)
    shown.set_signs([], Sign(400.0, 300.0, "#ffffff"))
    before = shown.to_widget(300.0, 200.0)
    drag(shown, (100, 100), (160, 140))
    after = shown.to_widget(300.0, 200.0)
    assert (after.x() - before.x(), after.y() - before.y()) == (60, 40)
    assert found == []


def test_nothing_is_marked_outside_the_photograph(shown):
    qtest, point, qt = mouse()
    found = []
    shown.marked.connect(lambda x, y: found.append((x, y)))
    shown.look_at(0.0, 0.0, 1.0)
    qtest.mouseClick(shown, qt.MouseButton.LeftButton, qt.KeyboardModifier.NoModifier, point(240, 300))
    assert found == []
    qtest.mouseClick(shown, qt.MouseButton.LeftButton, qt.KeyboardModifier.NoModifier, point(250, 200))
    assert found == [(pytest.approx(0.5), pytest.approx(0.5))]


def test_a_click_on_nothing_is_nothing(qgis):
    from strandline.provider.viewer import Viewer

    qtest, point, qt = mouse()
    viewer = Viewer()
    viewer.show()
    viewer.marked.connect(lambda x, y: pytest.fail("marked"))
    qtest.mouseClick(viewer, qt.MouseButton.LeftButton, qt.KeyboardModifier.NoModifier, point(20, 20))


@pytest.mark.parametrize(("kind", "width", "height"), [("JPEG", 4001, 1803), ("PNG", 2603, 1001), ("GTiff", 640, 480)])
def test_levels_are_exact_reductions(qgis, tmp_path, kind, width, height):
    """Pixel (i, j) of the level of factor f holds what lies about (i + 0.5) f, (j + 0.5) f, to the last column."""
    from strandline.provider.pixels import Source, opened, read_level

    path = tmp_path / "p.img"
    ramp(path, width, height, kind)
    source = Source(path, width, height)
    data = opened(source)
    for factor in (1, 2, 4, 8):
        level = read_level(data, factor, source)
        assert (level.image.width(), level.image.height()) == (width // factor, height // factor)
        for i, j in ((0, 0), (level.image.width() - 2, level.image.height() - 2), (level.image.width() // 2, 3)):
            colour = level.image.pixelColor(i, j)
            assert colour.red() == pytest.approx(255 * (i + 0.5) * factor / width, abs=1.6)
            assert colour.green() == pytest.approx(255 * (j + 0.5) * factor / height, abs=1.6)


def ramp(path, width, height, kind):
    from osgeo import gdal

    data = gdal.GetDriverByName("MEM").Create("", width, height, 3)
    red = bytes(int(255 * (x + 0.5) / width) for x in range(width))
    for y in range(height):
        data.GetRasterBand(1).WriteRaster(0, y, width, 1, red)
        data.GetRasterBand(2).WriteRaster(0, y, width, 1, bytes([int(255 * (y + 0.5) / height)]) * width)
    gdal.GetDriverByName(kind).CreateCopy(str(path), data, options=["QUALITY=98"] if kind == "JPEG" else [])


def test_more_than_8_bits_are_stretched(qgis, tmp_path):
    import struct

    from osgeo import gdal
    from strandline.provider.pixels import Source, opened, read_level

    data = gdal.GetDriverByName("GTiff").Create(str(tmp_path / "r.tif"), 1000, 40, 1, gdal.GDT_UInt16)
    line = struct.pack("1000H", *(2000 + 2 * i for i in range(1000)))
    for y in range(40):
        data.GetRasterBand(1).WriteRaster(0, y, 1000, 1, line)
    del data
    source = Source(tmp_path / "r.tif", 1000, 40)
    image = read_level(opened(source), 1, source).image
    assert image.pixelColor(0, 0).red() < 3
    assert image.pixelColor(999, 0).red() > 252
    assert image.pixelColor(500, 0).red() == pytest.approx(128, abs=3)


def wait_for(condition, seconds=20):
    import time

    from qgis.PyQt.QtCore import QCoreApplication

    end = time.monotonic() + seconds
    while not condition() and time.monotonic() < end:
        QCoreApplication.processEvents()
        time.sleep(0.005)
    assert condition()


def test_levels_arrive_coarsest_first_and_stay(qgis, tmp_path):
    from strandline.provider.pixels import Pixels, Source

    make_photograph(tmp_path / "p.jpg", 2400, 1200, "JPEG")
    source, seen = Source(tmp_path / "p.jpg", 2400, 1200), []
    pixels = Pixels()
    pixels.ready.connect(lambda s, level: seen.append(level.factor))
    assert pixels.want(source) == []
    wait_for(lambda: len(seen) == 4)
    assert seen == [8, 1, 2, 4]
    assert [level.factor for level in pixels.want(source)] == [8, 1, 2, 4]
    pixels.stop()


def test_what_is_no_longer_wanted_is_not_announced(qgis, tmp_path):
    from strandline.provider.pixels import Pixels, Source

    sources = []
    for name in "ab":
        make_photograph(tmp_path / f"{name}.jpg", 2400, 1200, "JPEG")
        sources.append(Source(tmp_path / f"{name}.jpg", 2400, 1200))
    seen = []
    pixels = Pixels()
    pixels.ready.connect(lambda s, level: seen.append((s.path.stem, level.factor)))
    pixels.want(sources[0])
    pixels.want(sources[1])
    wait_for(lambda: len(seen) == 4)
    assert seen == [("b", 8), ("b", 1), ("b", 2), ("b", 4)]
    pixels.stop()


@pytest.mark.parametrize(
    ("content", "size", "told"), [(None, (640, 480), "cannot be shown"), ("png", (641, 480), "the survey says")]
)
def test_what_cannot_be_shown_is_told(qgis, tmp_path, content, size, told):
    """An image of another size is refused: marks in a RAW's preview would lie elsewhere in the RAW."""
    from strandline.provider.pixels import Pixels, Source

    if content:
        make_photograph(tmp_path / "x.png")
    else:
        (tmp_path / "x.png").write_bytes(b"no picture")
    failed = []
    pixels = Pixels()
    pixels.failed.connect(lambda s, text: failed.append(text))
    pixels.want(Source(tmp_path / "x.png", *size))
    wait_for(lambda: failed)
    assert told in failed[0]
    assert "x.png" in failed[0]
    pixels.stop()
