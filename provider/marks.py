"""The marks' table: a plain layer with gcp, image, x, y that others may edit too, and the commands that undo."""

from pathlib import Path
from typing import Any, Callable, Dict, Iterable, List, NamedTuple, Optional, Tuple

from osgeo import ogr
from qgis.core import NULL, QgsFeature, QgsVectorLayer, QgsVectorLayerUtils
from qgis.PyQt.QtCore import QObject, QTimer, pyqtSignal

from ..i18n import tr
from .compat import QUndoCommand

FIELDS = ("gcp", "image", "x", "y")
Key = Tuple[str, str]  # ground point, photograph


class Mark(NamedTuple):
    """Where a point is seen (px from the top-left corner of the top-left pixel), and the score if a target was measured."""

    x: float
    y: float
    score: Optional[float] = None


Marks = Dict[Key, Mark]
Change = Dict[Key, Optional[Mark]]


class MarksError(Exception):
    """The table cannot be used or written; the text is one sentence for the user."""


def make_table(path: Path) -> None:
    """Make an empty table of marks: a CSV when the name says so, else a GeoPackage.

    Raises
    ------
    MarksError
        When it cannot be written, or a file stands there.
    """
    if path.exists():
        raise MarksError(tr("{} is there already.").format(path))
    try:
        if path.suffix.lower() == ".csv":
            path.write_text(",".join(FIELDS) + "\n", encoding="utf-8")
            path.with_suffix(".csvt").write_text('"String","String","Real","Real"\n', encoding="utf-8")
            return
        data = ogr.GetDriverByName("GPKG").CreateDataSource(str(path))
        if data is None:
            raise OSError(tr("it cannot be created there"))
        table = data.CreateLayer("marks", None, ogr.wkbNone, ["FID=fid"])
        for name, kind in zip(FIELDS, (ogr.OFTString, ogr.OFTString, ogr.OFTReal, ogr.OFTReal)):
            table.CreateField(ogr.FieldDefn(name, kind))
    except (OSError, RuntimeError) as error:
        raise MarksError(tr("The table of marks {} cannot be made: {}.").format(path, error)) from error


class MarksTable(QObject):
    """The marks in a layer. What others do to the layer is seen, and ``changed`` is emitted."""

    changed = pyqtSignal()

    def __init__(self, layer: QgsVectorLayer, parent: Optional[QObject] = None) -> None:
        """Raise MarksError when ``layer`` has not the four fields."""
        super().__init__(parent)
        self.layer = layer
        self._places = {f.name().casefold(): i for i, f in enumerate(layer.fields())}
        missing = [name for name in FIELDS if name not in self._places]
        if missing:
            raise MarksError(tr("The table {} has no field {}: marks need gcp, image, x and y.").format(layer.name(), missing[0]))
        self._named: Callable[[str, str], Optional[Key]] = lambda gcp, image: (gcp, image)
        self._marks: Marks = {}
        self._rows: Dict[Key, List[int]] = {}
        self.unread: List[str] = []
        self._writing = False
        self._soon = QTimer(self)
        self._soon.setSingleShot(True)
        self._soon.timeout.connect(self.reload)
        for signal in (layer.featureAdded, layer.featureDeleted, layer.attributeValueChanged, layer.dataChanged):
            signal.connect(self._heard)
        layer.afterRollBack.connect(self._heard)
        self.reload()

    def set_names(self, named: Callable[[str, str], Optional[Key]]) -> None:
        """Say which point and photograph the words of a row mean; None for neither."""
        self._named = named
        self.reload()

    def marks(self) -> Marks:
        """Return all marks."""
        return dict(self._marks)

    def get(self, key: Key) -> Optional[Mark]:
        """Return a mark, None where there is none."""
        return self._marks.get(key)

    def reload(self) -> None:
        """Read the layer again."""
        marks: Marks = {}
        rows: Dict[Key, List[int]] = {}
        self.unread = []
        for feature in self.layer.getFeatures():
            values = feature.attributes()
            gcp, image = (_text(values[self._places[name]]) for name in ("gcp", "image"))
            x, y = (number(values[self._places[name]]) for name in ("x", "y"))
            key = self._named(gcp, image)
            if key is None or x is None or y is None:
                self.unread.append(f"{gcp or '-'}, {image or '-'}")
                continue
            rows.setdefault(key, []).append(feature.id())
            score = number(values[self._places["score"]]) if "score" in self._places else None
            # The engine refuses a point that is marked twice in a photograph: the first is shown, the others told of.
            if marks.setdefault(key, Mark(x, y, score)) != Mark(x, y, score):
                self.unread.append(f"{gcp}, {image}")
        self._marks, self._rows = marks, rows
        self.changed.emit()

    def write(self, change: Change) -> None:
        """Set marks, or remove those that are None; into the user's own editing session when there is one.

        Raises
        ------
        MarksError
            When the layer cannot be edited; nothing is changed then.
        """
        if not change:
            return
        own = not self.layer.isEditable()
        self._writing = True
        try:
            if own and not self.layer.startEditing():
                raise MarksError(tr("The table {} cannot be edited: save it as a GeoPackage first.").format(self.layer.name()))
            self.layer.beginEditCommand(tr("Marks"))
            done = all(self._write_one(key, mark) for key, mark in change.items())
            self.layer.endEditCommand()
            if not done or (own and not self.layer.commitChanges()):
                told = "; ".join(self.layer.commitErrors())
                if own:
                    self.layer.rollBack()
                raise MarksError(tr("The table {} cannot be written: {}").format(self.layer.name(), told or "?"))
        finally:
            self._writing = False
            self.reload()

    def _write_one(self, key: Key, mark: Optional[Mark]) -> bool:
        rows = self._rows.get(key, [])
        if mark is None:
            return all(self.layer.deleteFeature(row) for row in rows)
        values: Dict[int, Any] = {self._places["x"]: round(mark.x, 3), self._places["y"]: round(mark.y, 3)}
        if "score" in self._places:
            values[self._places["score"]] = NULL if mark.score is None else round(mark.score, 3)
        if "sigma" in self._places:
            values[self._places["sigma"]] = NULL  # it was that of a prediction
        if rows:
            return all(self.layer.changeAttributeValues(row, values) for row in rows)
        values.update({self._places["gcp"]: key[0], self._places["image"]: key[1]})
        feature: QgsFeature = QgsVectorLayerUtils.createFeature(self.layer, attributes=values)
        return bool(self.layer.addFeature(feature))

    def _heard(self, *_: Any) -> None:
        if not self._writing:
            self._soon.start(0)  # once for many changes


class PutMarks(QUndoCommand):
    """Sets or removes marks; undone it puts back what stood."""

    def __init__(self, table: MarksTable, change: Change, text: str, told: Callable[[str], None]) -> None:
        super().__init__(text)
        self._table, self._after, self._told = table, dict(change), told
        self._before: Change = {key: table.get(key) for key in change}

    def redo(self) -> None:
        """Do it."""
        self._write(self._after)

    def undo(self) -> None:
        """Put back what stood."""
        self._write(self._before)

    def _write(self, change: Change) -> None:
        try:
            self._table.write(change)
        except MarksError as error:
            self.setObsolete(True)
            self._told(str(error))


def renamed(names: Iterable[str]) -> Callable[[str], Optional[str]]:
    """Return what finds a name as the engine does at first: whatever the case and the blanks."""
    known = {_key(name): name for name in names}
    return lambda wanted: known.get(_key(wanted))


def photograph_named(names: Iterable[str]) -> Callable[[str], Optional[str]]:
    """Return what finds a photograph by its name, without folder or extension if need be, None when none or several fit."""
    levels: List[Dict[str, List[str]]] = [{}, {}, {}]
    for name in names:
        path = name.strip().replace("\\", "/").casefold()
        last = path.rpartition("/")[2]
        for level, word in zip(levels, (path, last, last.rpartition(".")[0] or last)):
            level.setdefault(word, []).append(name)

    def find(wanted: str) -> Optional[str]:
        path = wanted.strip().replace("\\", "/").casefold()
        last = path.rpartition("/")[2]
        for level, word in ((0, path), (1, last), (2, last), (2, last.rpartition(".")[0] or last)):
            found = levels[level].get(word, [])
            if found:
                return found[0] if len(found) == 1 else None
        return None

    return find


def _key(name: str) -> str:
    return "".join(name.split()).casefold()


def _text(value: Any) -> str:
    return "" if value is None or value == NULL else str(value).strip()


def number(value: Any) -> Optional[float]:
    """Return a number that may come as text, as spreadsheets write it."""
    if value is None or value == NULL:
        return None
    try:
        return float(str(value).strip().replace(",", "."))
    except ValueError:
        return None
