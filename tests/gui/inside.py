"""Run by QGIS itself (``--code``): opens the dock on a survey, then tells a file where on the screen everything is."""

import json
import os
from pathlib import Path

from qgis.core import QgsApplication, QgsProject, QgsVectorLayer
from qgis.PyQt.QtCore import QPoint, QTimer
from qgis.utils import iface, plugins

told = Path(os.environ["STRANDLINE_GUI_STATE"])
simulation = Path(os.environ["STRANDLINE_GUI_SIMULATION"])
survey = Path(os.environ["STRANDLINE_GUI_SURVEY"])


def rect(widget, inner=None):
    inner = widget.rect() if inner is None else inner
    corner = widget.mapToGlobal(inner.topLeft())
    return [corner.x(), corner.y(), inner.width(), inner.height()]


def state():
    dock = plugins["strandline"]._desktop._dock
    viewer, tree = dock.pane.viewer, dock.list
    items = {}
    for i in range(tree.topLevelItemCount()):
        item = tree.topLevelItem(i)
        place = tree.visualItemRect(item)
        items[item.text(0)] = {
            "rect": rect(tree.viewport(), place),
            "shown": tree.viewport().rect().contains(place),
            "texts": [item.text(1), item.text(2)],
        }
    origin = viewer.mapToGlobal(QPoint(0, 0))
    corner = viewer.to_widget(0.0, 0.0)
    marking = dock.marking
    return {
        "busy": dock.background.busy,
        "message": dock.message.text(),
        "verdict": dock.verdict.text(),
        "items": items,
        "list": rect(tree.viewport()),
        "key": dock.pane.key,
        "levels": [level.factor for level in viewer._levels],
        "viewer": {"rect": rect(viewer), "corner": [origin.x() + corner.x(), origin.y() + corner.y()], "scale": viewer.scale},
        "buttons": {name: rect(getattr(dock, name)) for name in ("predict", "measure", "adjust", "show_map", "undo", "redo")},
        "predictions": len(marking.predictions) if marking else 0,
        "residuals": {k: [v.plan, v.up, v.judgement] for k, v in marking.residuals.items()} if marking else {},
        "marks": [[*k, m.x, m.y] for k, m in marking.table.marks().items()] if marking else [],
        "offsets": [o for o in (marking.sight(k).offset for k in marking.table.marks()) if o is not None] if marking else [],
        "layers": [layer.name() for layer in QgsProject.instance().mapLayers().values()],
        "window": rect(iface.mainWindow()),
        "dock": rect(dock),
    }


def tell():
    part = told.with_suffix(".part")
    part.write_text(json.dumps(state()))
    part.replace(told)


def start():
    window = iface.mainWindow()
    window.showNormal()
    window.setGeometry(0, 20, 1280, 876)
    (date,) = simulation.glob("????-*")
    layer = QgsVectorLayer(str(date / "gcps.gpkg"), "gcps", "ogr")
    QgsProject.instance().addMapLayer(layer)
    iface.setActiveLayer(layer)
    iface.zoomToActiveLayer()
    dock = plugins["strandline"]._desktop.show_dock()
    window.resizeDocks([dock], [int(os.environ.get("STRANDLINE_GUI_WIDTH", "560"))], 1)
    table = dock.chooser.use_table(Path(os.environ["STRANDLINE_GUI_MARKS"]))
    dock.chooser.choose(str(survey), layer, table)
    timer = QTimer(window)
    timer.timeout.connect(tell)
    timer.start(100)


QgsApplication.instance().processEvents()
QTimer.singleShot(2000, start)
