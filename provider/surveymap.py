"""A survey in the map: a group with photographs, footprints, tie points, residuals, surface and orthophoto, styled."""

import datetime
import shutil
from pathlib import Path
from typing import Any, Callable, Dict, List, Optional

from qgis.core import QgsLayerTreeGroup, QgsMapLayer, QgsProject, QgsRasterLayer, QgsVectorLayer

from ..algorithms.styles import TERRAIN
from ..bridge.survey import SurveyView
from ..i18n import tr
from . import mapstyles
from .background import Background

_FOLDER = "layers"  # of the survey: what belongs to its map and can be made again


def add_survey(
    survey: SurveyView, background: Background, done: Callable[[List[str]], None], failed: Callable[[str], None]
) -> bool:
    """Have the engine write the layers, then load all that there is; ``done`` gets what is to be told.

    Return whether that was started.
    """
    folder = survey.folder / _FOLDER
    try:
        folder.mkdir(exist_ok=True)
    except OSError as error:
        failed(tr("The layers cannot be written to {}: {}.").format(folder, error))
        return False
    wanted = ["photos"]
    if survey.state("georeference") == "ready":
        wanted += ["footprints", "tie_points"]
    files = {name: folder / f"{name}.gpkg" for name in wanted}
    forget(files.values())
    parameters: Dict[str, Any] = {"SURVEY": str(survey.folder), "MAX_POINTS": 50000}
    parameters.update({name.upper(): str(path) for name, path in files.items()})

    def arrived(results: Any, warnings: List[str]) -> None:
        load(SurveyView.read(str(survey.folder)), files, QgsProject.instance())
        done(warnings)

    return background.run("surveylayers", parameters, arrived, failed)


def keep_residuals(survey: SurveyView, file: str) -> None:
    """Keep the residuals of an adjustment for the map.

    Raises
    ------
    OSError
        When they cannot be written.
    """
    target = survey.folder / _FOLDER / "residuals.gpkg"
    target.parent.mkdir(exist_ok=True)
    forget([target])
    shutil.copyfile(file, target)


def load(survey: SurveyView, files: Dict[str, Path], project: QgsProject) -> QgsLayerTreeGroup:
    """Put what there is into a group named after the survey, the topmost first."""
    name = tr("Survey {}").format(survey.folder.resolve().name)
    old = project.layerTreeRoot().findGroup(name)
    if old is not None:
        project.removeMapLayers([leaf.layerId() for leaf in old.findLayers()])
        project.layerTreeRoot().removeChildNode(old)
    group = project.layerTreeRoot().insertGroup(0, name)
    residuals = survey.folder / _FOLDER / "residuals.gpkg"
    if residuals.is_file() and residuals.stat().st_mtime >= _finished(survey, "georeference"):
        layer = _vector(residuals, tr("Residuals"))
        if layer is not None:
            factor = mapstyles.draw_residuals(layer)
            layer.setName(tr("Residuals, {} times enlarged").format(f"{factor:g}"))
            _add(group, layer, project)
    for key, title, draw in (
        ("photos", tr("Photographs"), mapstyles.draw_photographs),
        ("tie_points", tr("Tie points"), mapstyles.draw_tie_points),
        ("footprints", tr("Footprints"), mapstyles.draw_footprints),
    ):
        layer = _vector(files[key], title) if key in files else None
        if layer is not None:
            draw(layer)
            leaf = _add(group, layer, project)
            leaf.setItemVisibilityChecked(key == "photos")  # the others are many: on demand
    _add_rasters(group, survey, project)
    return group


def forget(paths: Any) -> None:
    """Take layers of these files out of the project, so that they can be written."""
    project = QgsProject.instance()
    gone = {Path(path) for path in paths}
    project.removeMapLayers([key for key, layer in project.mapLayers().items() if Path(layer.source().partition("|")[0]) in gone])


def _add_rasters(group: QgsLayerTreeGroup, survey: SurveyView, project: QgsProject) -> None:
    """Add orthophoto and surface where the last export left them, the surface in colours under its hillshade."""
    given = survey.parameters("exportdsm") if survey.state("exportdsm") == "ready" else {}
    ortho, surface = (_raster(given.get(key), title) for key, title in (("ortho", tr("Orthophoto")), ("output", tr("Surface"))))
    if ortho is not None:
        _add(group, ortho, project)
    if surface is not None:
        shade = _raster(given["output"], tr("Hillshade"))
        mapstyles.draw_hillshade(shade)
        TERRAIN.postProcessLayer(surface, None, None)
        for layer in (shade, surface):
            leaf = _add(group, layer, project)
            leaf.setItemVisibilityChecked(True)


def _finished(survey: SurveyView, step: str) -> float:
    """Return when ``step`` was finished, in seconds; infinity when it was not, or not on what stands."""
    told = survey.finished(step)
    if survey.state(step) != "ready" or not told:
        return float("inf")
    return datetime.datetime.fromisoformat(told).timestamp()


def _add(group: QgsLayerTreeGroup, layer: QgsMapLayer, project: QgsProject) -> Any:
    project.addMapLayer(layer, False)
    leaf = group.addLayer(layer)
    leaf.setExpanded(False)
    return leaf


def _vector(path: Path, title: str) -> Optional[QgsVectorLayer]:
    layer = QgsVectorLayer(str(path), title, "ogr") if path.is_file() else None
    return layer if layer is not None and layer.isValid() else None


def _raster(path: Any, title: str) -> Optional[QgsRasterLayer]:
    layer = QgsRasterLayer(str(path), title, "gdal") if path and Path(path).is_file() else None
    return layer if layer is not None and layer.isValid() else None
