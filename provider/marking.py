"""The work of marking, without a window: what is seen where, what is marked, what comes next, and undo."""

from typing import Dict, List, NamedTuple, Optional, Set

from qgis.core import QgsProject, QgsVectorLayer
from qgis.PyQt.QtCore import QObject, pyqtSignal

from ..bridge.survey import Photograph, SurveyView
from ..i18n import tr
from .compat import QUndoStack
from .groundpoints import Fields, GroundPoint, ground_points, nearest
from .judgement import Prediction, Residual, judge_mark, offset
from .marks import Change, Key, Mark, Marks, MarksTable, PutMarks, photograph_named, renamed

_TOGETHER = 3.0  # px: a target measured this near to a mark made by eye is the same thing, better measured


class Sight(NamedTuple):
    """A ground point in a photograph that shows it, or may."""

    point: str
    photograph: Photograph
    prediction: Optional[Prediction]
    mark: Optional[Mark]
    skipped: bool

    @property
    def key(self) -> Key:
        """How the marks' table names it."""
        return self.point, self.photograph.name

    @property
    def offset(self) -> Optional[float]:
        """How far (px) the mark lies from its prediction."""
        return offset(self.mark, self.prediction) if self.mark and self.prediction else None

    @property
    def judgement(self) -> str:
        """What the prediction says of the mark."""
        return judge_mark(self.mark, self.prediction)


class Marking(QObject):
    """Survey, ground points and marks together. ``changed`` when marks, predictions or residuals have."""

    changed = pyqtSignal()
    told = pyqtSignal(str)  # a sentence for the user: something did not work

    def __init__(
        self, survey: SurveyView, layer: QgsVectorLayer, fields: Fields, table: MarksTable, parent: Optional[QObject] = None
    ) -> None:
        super().__init__(parent)
        self.survey, self.layer, self.fields, self.table = survey, layer, fields, table
        self.undo = QUndoStack(self)
        self.predictions: Dict[Key, Prediction] = {}
        self.residuals: Dict[str, Residual] = {}
        self._skipped: Set[Key] = set()
        self._scores: Marks = {}  # a table may have no column for them
        self._near: Dict[str, List[str]] = {}
        self.points: List[GroundPoint] = []
        self._photographs = {p.name: p for p in survey.photographs}
        self.read_points()
        table.changed.connect(self.changed)

    def read_points(self) -> None:
        """Read the ground points again."""
        self.points = ground_points(self.layer, self.fields)
        self._near = {}
        point_of = renamed(p.name for p in self.points)
        photo_of = photograph_named(self._photographs)

        def named(gcp: str, image: str) -> Optional[Key]:
            point, photo = point_of(gcp), photo_of(image)
            return (point, photo) if point and photo else None

        self.table.set_names(named)
        self.changed.emit()

    def point(self, name: str) -> Optional[GroundPoint]:
        """Return the point called ``name``."""
        return next((p for p in self.points if p.name == name), None)

    def mark_count(self, point: str) -> int:
        """Return in how many photographs a point is marked."""
        return sum(gcp == point for gcp, _ in self.table.marks())

    def sights(self, point: str) -> List[Sight]:
        """Return the photographs that should show ``point``, nearest to their middle first.

        Without predictions: all, in the order of their positions' distance. What is marked is there in any case.
        """
        names = [image for gcp, image in self.predictions if gcp == point and image in self._photographs]
        if not names and not self.predictions:
            names = self._by_distance(point)
        marks = self.table.marks()
        names += [image for gcp, image in marks if gcp == point and image not in set(names)]
        return [self.sight((point, name)) for name in names]

    def _by_distance(self, point: str) -> List[str]:
        """Return all photographs, those with a position first."""
        if point not in self._near:
            ground = self.point(point)
            near = nearest(ground, self.layer.crs(), self.survey.photographs, QgsProject.instance()) if ground else None
            names = dict.fromkeys(p.name for p in (near or []))
            self._near[point] = [*names, *(name for name in self._photographs if name not in names)]
        return list(self._near[point])

    def sight(self, key: Key) -> Sight:
        """Return what is known of a point in a photograph."""
        mark, measured = self.table.get(key), self._scores.get(key)
        if mark is not None and measured is not None and offset(mark, Prediction(measured.x, measured.y, None)) < 0.002:
            mark = mark._replace(score=measured.score)
        return Sight(key[0], self._photographs[key[1]], self.predictions.get(key), mark, key in self._skipped)

    def step(self, key: Optional[Key], by: int, *, open_only: bool = False) -> Optional[Key]:
        """Return the sight ``by`` (1 or -1) after ``key`` in the order of the list, over the points' ends; None at the end.

        ``open_only`` passes over what is marked or skipped.
        """
        order = [sight for point in self.points for sight in self.sights(point.name)]
        keys = [sight.key for sight in order]
        if key in keys:
            place = keys.index(key) + by
        else:  # a point, or nothing
            heads = [i for i, k in enumerate(keys) if key is not None and k[0] == key[0]]
            place = (heads[0] if by > 0 else heads[0] - 1) if heads else 0
        while 0 <= place < len(order):
            if not open_only or (order[place].mark is None and not order[place].skipped):
                return order[place].key
            place += by
        return None

    def put(self, key: Key, mark: Mark) -> None:
        """Set or move a mark."""
        word = tr("move the mark of {}") if self.table.get(key) else tr("mark {}")
        self._skipped.discard(key)
        self._do({key: mark}, word.format(key[0]))

    def remove(self, key: Key) -> None:
        """Remove a mark."""
        if self.table.get(key):
            self._do({key: None}, tr("remove the mark of {}").format(key[0]))

    def skip(self, key: Key, skipped: bool = True) -> None:
        """Note that a point cannot be seen in a photograph; for this session, the table knows no such thing."""
        (self._skipped.add if skipped else self._skipped.discard)(key)
        self.changed.emit()

    def take_measured(self, measured: Marks) -> "tuple[int, int]":
        """Take marks of targets that were measured, as one step to undo; return how many, and how many were left.

        A mark made by eye gives way to a measurement within three pixels. One further off stays: somebody saw something else.
        """
        change: Change = {}
        left = 0
        self._scores.update(measured)
        for key, mark in measured.items():
            standing = self.table.get(key)
            if standing is not None and max(abs(standing.x - mark.x), abs(standing.y - mark.y)) > _TOGETHER:
                left += 1
            else:
                change[key] = mark
        if change:
            self._do(change, tr("measure {} targets").format(len(change)))
        return len(change), left

    def take_predictions(self, predictions: Dict[Key, Prediction]) -> None:
        """Take where points should be seen, each point's best photographs first."""
        self.predictions = dict(predictions)
        self.changed.emit()

    def take_residuals(self, residuals: Dict[str, Residual]) -> None:
        """Take what an adjustment left."""
        self.residuals = dict(residuals)
        self.changed.emit()

    def _do(self, change: Change, text: str) -> None:
        self.undo.push(PutMarks(self.table, change, text, self.told.emit))
