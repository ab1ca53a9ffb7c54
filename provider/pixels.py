"""A photograph's pixels at several sizes, read by GDAL in the background: the coarsest first, to see something at once."""

from pathlib import Path
from typing import Any, Dict, List, NamedTuple, Optional, Tuple

from osgeo import gdal
from qgis.PyQt.QtCore import QObject, QRunnable, QThreadPool, pyqtSignal
from qgis.PyQt.QtGui import QImage

from ..i18n import tr

_LARGE = 2000  # pixels of the longer side from which a coarse level comes first
_BUDGET = 450_000_000  # bytes of decoded photographs kept: two of 42 megapixels with their levels
_QUANTILES = (0.005, 0.995)  # become black and white where there are more than 8 bits
_BINS = 4096


class UnreadablePhotograph(Exception):
    """A photograph cannot be shown; the text is one sentence for the user."""


class Level(NamedTuple):
    """The photograph reduced by ``factor``; ``data`` is what ``image`` lies on, and has to live as long."""

    factor: int
    image: QImage
    data: Any


class Source(NamedTuple):
    """A file to show, and the size its pixels count in."""

    path: Path
    width: int
    height: int

    def factors(self) -> Tuple[int, ...]:
        """Return the levels' factors in the order of reading: one to see, the full one to mark in, those between to draw well.

        JPG is decoded at a half, a quarter or an eighth without its finer coefficients, in less time than the whole.
        """
        return (8, 1, 2, 4) if max(self.width, self.height) > _LARGE else (1, 2, 4)


class Pixels(QObject):
    """Hands out levels as they are read, and keeps the photographs seen last."""

    ready = pyqtSignal(object, object)  # Source, Level
    failed = pyqtSignal(object, str)

    def __init__(self, parent: Optional[QObject] = None) -> None:
        super().__init__(parent)
        self._pool = QThreadPool(self)
        self._pool.setMaxThreadCount(2)  # what is wanted now need not wait until what was wanted before has stopped
        self._kept: Dict[Source, List[Level]] = {}
        self._reading: Dict[Source, _Reading] = {}
        self._stopping: List[_Reading] = []

    def want(self, source: Source) -> List[Level]:
        """Return the levels that are there; ``ready`` announces those that are still to come."""
        for other in [s for s in self._reading if s != source]:
            self._abandon(other)
        if source in self._kept:
            self._kept[source] = self._kept.pop(source)  # the last of the dictionary: seen last
        else:
            reading = _Reading(source)
            reading.signals.ready.connect(self._take)
            reading.signals.failed.connect(self._fail)
            self._reading[source], self._kept[source] = reading, []
            self._pool.start(reading)
        return list(self._kept[source])

    def stop(self) -> None:
        """Stop reading, wait until that is so, and forget all."""
        for source in list(self._reading):
            self._abandon(source)
        self._pool.waitForDone()
        self._stopping.clear()
        self._kept.clear()

    def _abandon(self, source: Source) -> None:
        reading = self._reading.pop(source)
        reading.stopped = True
        del self._kept[source]  # its levels are not complete
        self._stopping = [r for r in self._stopping if not r.ended] + [reading]  # alive until its thread is through

    def _take(self, source: Source, level: Level) -> None:
        if source not in self._reading:
            return
        self._kept[source].append(level)
        if len(self._kept[source]) == len(source.factors()):
            self._stopping.append(self._reading.pop(source))
        for old in [s for s in self._kept if s != source]:
            if sum(_bytes(levels) for levels in self._kept.values()) <= _BUDGET:
                break
            del self._kept[old]
        self.ready.emit(source, level)

    def _fail(self, source: Source, told: str) -> None:
        if source in self._reading:
            self._abandon(source)
            self.failed.emit(source, told)


class _Signals(QObject):
    ready = pyqtSignal(object, object)
    failed = pyqtSignal(object, str)


class _Reading(QRunnable):
    """Reads all levels of one file, unless it is stopped. It announces from its own thread, Qt carries that over."""

    def __init__(self, source: Source) -> None:
        super().__init__()
        self.setAutoDelete(False)  # Python owns it
        self.source, self.signals, self.stopped, self.ended = source, _Signals(), False, False

    def run(self) -> None:
        """Read; Qt calls this in a thread of its pool."""
        gdal.PushErrorHandler("CPLQuietErrorHandler")  # of this thread alone
        try:
            data = opened(self.source)
            for factor in self.source.factors():
                if self.stopped:
                    return
                self.signals.ready.emit(self.source, read_level(data, factor, self.source))
        except UnreadablePhotograph as error:
            self.signals.failed.emit(self.source, str(error))
        finally:
            gdal.PopErrorHandler()
            self.ended = True


def opened(source: Source) -> gdal.Dataset:
    """Return the file as GDAL sees it, brought to 8 bits.

    Raises
    ------
    UnreadablePhotograph
        When GDAL cannot read it, or sees an image of another size (a RAW's preview): marks in it would be wrong.
    """
    data = _try(gdal.Open, str(source.path))
    if data is None:
        raise UnreadablePhotograph(tr("{} cannot be shown: {}.").format(source.path, gdal.GetLastErrorMsg() or tr("not found")))
    if (data.RasterXSize, data.RasterYSize) != (source.width, source.height):
        told = tr("{} cannot be shown: it holds {} x {} pixels, the survey says {} x {}.")
        raise UnreadablePhotograph(told.format(source.path, data.RasterXSize, data.RasterYSize, source.width, source.height))
    if data.GetRasterBand(1).DataType == gdal.GDT_Byte:
        return data
    low, high = _stretch(data.GetRasterBand(1), source.path)
    return gdal.Translate("", data, format="VRT", outputType=gdal.GDT_Byte, scaleParams=[[low, high, 0, 255]])


def read_level(data: gdal.Dataset, factor: int, source: Source) -> Level:
    """Return the image reduced by ``factor``, whose pixels are squares of exactly so many.

    What is left over at the right and lower edge is seen in finer levels only.

    Raises
    ------
    UnreadablePhotograph
        When the file is damaged.
    """
    width, height = max(1, source.width // factor), max(1, source.height // factor)
    bands = [1, 2, 3] if data.RasterCount >= 3 else [1]
    line = (len(bands) * width + 3) // 4 * 4  # Qt wants lines to start at multiples of four
    # A file that holds no smaller versions of itself is averaged; of JPG those that GDAL offers are taken as they are.
    offers = data.GetRasterBand(1).GetOverviewCount() > 0
    pixels = _try(
        data.ReadRaster,
        0,
        0,
        min(source.width, width * factor),
        min(source.height, height * factor),
        width,
        height,
        band_list=bands,
        buf_pixel_space=len(bands),
        buf_line_space=line,
        buf_band_space=1,
        resample_alg=gdal.GRIORA_NearestNeighbour if offers or factor == 1 else gdal.GRIORA_Average,
    )
    if pixels is None:
        raise UnreadablePhotograph(tr("{} cannot be shown: {}.").format(source.path, gdal.GetLastErrorMsg() or tr("damaged")))
    kind = QImage.Format.Format_RGB888 if len(bands) == 3 else QImage.Format.Format_Grayscale8
    return Level(factor, QImage(pixels, width, height, line, kind), pixels)


def _stretch(band: gdal.Band, path: Path) -> Tuple[float, float]:
    """Return what is to be black and white."""
    limits = _try(band.ComputeRasterMinMax, True)
    if not limits or not limits[1] > limits[0]:
        raise UnreadablePhotograph(tr("{} cannot be shown: {}.").format(path, tr("it is all one value")))
    low, high = limits
    counts = _try(band.GetHistogram, low, high, _BINS, True, True) or []
    total, seen, found = sum(counts), 0, []
    for place, count in enumerate(counts):
        seen += count
        while len(found) < 2 and seen >= _QUANTILES[len(found)] * total > 0:
            found.append(low + (high - low) * (place + len(found)) / _BINS)
    return (found[0], found[1]) if len(found) == 2 and found[1] > found[0] else (low, high)


def _try(function: Any, *values: Any, **named: Any) -> Any:
    """Call GDAL, which answers None or raises as the rest of QGIS has set it."""
    try:
        return function(*values, **named)
    except RuntimeError:
        return None


def _bytes(levels: List[Level]) -> int:
    return sum(len(level.data) for level in levels)
