"""What is marked: survey folder, ground points with their fields, marks' table; asked for at the head of the dock."""

from pathlib import Path
from typing import Any, Optional

from qgis.core import QgsFieldProxyModel, QgsMapLayerProxyModel, QgsProject, QgsVectorLayer
from qgis.gui import QgsFieldComboBox, QgsFileWidget, QgsMapLayerComboBox
from qgis.PyQt.QtCore import pyqtSignal
from qgis.PyQt.QtWidgets import QFileDialog, QFormLayout, QHBoxLayout, QSizePolicy, QToolButton, QWidget

from ..i18n import tr
from .groundpoints import Fields, likely_fields
from .marks import FIELDS, MarksError, make_table


class Chooser(QWidget):
    """A form; ``chosen`` when something in it has changed."""

    chosen = pyqtSignal()
    told = pyqtSignal(str)

    def __init__(self, parent: Optional[QWidget] = None) -> None:
        super().__init__(parent)
        self.survey = QgsFileWidget()
        self.survey.setStorageMode(QgsFileWidget.StorageMode.GetDirectory)
        self.survey.setDialogTitle(tr("Survey folder"))
        self.points = _layers(QgsMapLayerProxyModel.Filter.PointLayer)
        self.marks = _layers(QgsMapLayerProxyModel.Filter.VectorLayer)
        self.marks.setToolTip(tr("A table with the fields gcp, image, x, y, in pixels from the top-left corner."))
        self.new = QToolButton()
        self.new.setText(tr("New..."))
        self.new.setToolTip(tr("Make an empty table of marks, or open one that is there."))
        self.new.clicked.connect(self._ask_table)
        self.name, self.height, self.role, self.sigma_h, self.sigma_v = (QgsFieldComboBox() for _ in range(5))
        for box in (self.height, self.role, self.sigma_h, self.sigma_v):
            box.setAllowEmptyFieldName(True)
        for box in (self.height, self.sigma_h, self.sigma_v):
            box.setFilters(QgsFieldProxyModel.Filter.Numeric | QgsFieldProxyModel.Filter.String)
        self.height.setToolTip(tr("Without a field the height is the Z of the geometry."))
        self.role.setToolTip(tr("Which points are control and which only check."))
        self._lay_out()
        self.survey.fileChanged.connect(self._changed)
        self.points.layerChanged.connect(self._take_layer)
        self.marks.layerChanged.connect(self._changed)
        for box in (self.name, self.height, self.role, self.sigma_h, self.sigma_v):
            box.fieldChanged.connect(self._changed)
        self._quiet = False
        self._take_layer(self.points.currentLayer())

    def fields(self) -> Fields:
        """Return the fields chosen."""
        return Fields(*(b.currentField() for b in (self.name, self.height, self.role, self.sigma_h, self.sigma_v)))

    def table(self) -> Optional[QgsVectorLayer]:
        """Return the chosen table when it holds marks."""
        layer = self.marks.currentLayer()
        return layer if layer is not None and _is_table(layer) else None

    def choose(self, survey: str, points: Optional[QgsVectorLayer], marks: Optional[QgsVectorLayer]) -> None:
        """Choose all at once."""
        self._quiet = True
        self.survey.setFilePath(survey)
        self.points.setLayer(points)
        self._take_layer(points)
        self.marks.setLayer(marks)
        self._quiet = False
        self._changed()

    def use_table(self, path: Path) -> Optional[QgsVectorLayer]:
        """Open the table ``path``, made if absent, as a layer of the project, and choose it."""
        try:
            if not path.exists():
                make_table(path)
        except MarksError as error:
            self.told.emit(str(error))
            return None
        for layer in QgsProject.instance().mapLayers().values():
            if isinstance(layer, QgsVectorLayer) and Path(layer.source().partition("|")[0]) == path:
                self.marks.setLayer(layer)
                return layer
        layer = QgsVectorLayer(str(path), path.stem, "ogr")
        if not layer.isValid() or not _is_table(layer):
            self.told.emit(tr("{} is not a table of marks: it needs the fields gcp, image, x and y.").format(path))
            return None
        QgsProject.instance().addMapLayer(layer)
        self.marks.setLayer(layer)
        return layer

    def _ask_table(self) -> None:
        survey = self.survey.filePath()
        start = str(Path(survey).parent / "marks.gpkg") if survey else "marks.gpkg"
        kinds = tr("GeoPackage (*.gpkg);;Comma-separated values (*.csv)")
        options = QFileDialog.Option.DontConfirmOverwrite
        chosen, kind = QFileDialog.getSaveFileName(self, tr("Table of marks"), start, kinds, options=options)
        if chosen:
            path = Path(chosen)
            self.use_table(path if path.suffix else path.with_suffix(".csv" if "csv" in kind else ".gpkg"))

    def _take_layer(self, layer: Any) -> None:
        quiet, self._quiet = self._quiet, True
        boxes = (self.name, self.height, self.role, self.sigma_h, self.sigma_v)
        for box in boxes:
            box.setLayer(layer)
        if layer is not None:
            for box, field in zip(boxes, likely_fields(layer.fields())):
                box.setField(field)
        self._quiet = quiet
        self._changed()

    def _changed(self, *_: Any) -> None:
        if not self._quiet:
            self.chosen.emit()

    def _lay_out(self) -> None:
        form = QFormLayout(self)
        form.setContentsMargins(0, 0, 0, 0)
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.ExpandingFieldsGrow)
        form.setRowWrapPolicy(QFormLayout.RowWrapPolicy.DontWrapRows)
        form.addRow(tr("Survey"), self.survey)
        form.addRow(tr("Ground points"), _beside(self.points))
        form.addRow(tr("Name, height"), _beside(self.name, self.height))
        form.addRow(tr("Role"), _beside(self.role))
        form.addRow(tr("Sigmas"), _beside(self.sigma_h, self.sigma_v))
        form.addRow(tr("Marks"), _beside(self.marks, self.new))


def _layers(kind: Any) -> QgsMapLayerComboBox:
    box = QgsMapLayerComboBox()
    box.setFilters(kind)
    box.setAllowEmptyLayer(True)
    box.setMinimumWidth(60)
    return box


def _is_table(layer: QgsVectorLayer) -> bool:
    return set(FIELDS) <= {field.name().casefold() for field in layer.fields()}


def _beside(*widgets: QWidget) -> QWidget:
    both = QWidget()
    row = QHBoxLayout(both)
    row.setContentsMargins(0, 0, 0, 0)
    for widget in widgets:
        if not isinstance(widget, QToolButton):
            widget.setMinimumWidth(60)
            widget.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
        row.addWidget(widget, 0 if isinstance(widget, QToolButton) else 1)
    return both
