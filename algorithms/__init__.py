"""The Processing algorithms, one file each, named after the id."""

from .checkengine import CheckEngine
from .compareinputs import CompareInputs
from .createsurvey import CreateSurvey
from .dsmdifference import DsmDifference
from .enhance import Enhance
from .exportdsm import ExportDsm
from .georeference import Georeference
from .orient import Orient
from .predictmarks import PredictMarks
from .profiles import Profiles
from .shoreline import Shoreline
from .simulatesurvey import SimulateSurvey
from .surveylayers import SurveyLayers
from .tiepoints import TiePoints
from .timeseries import TimeSeries

ALGORITHMS = (
    CreateSurvey,
    Enhance,
    TiePoints,
    Orient,
    Georeference,
    PredictMarks,
    SurveyLayers,
    ExportDsm,
    DsmDifference,
    Profiles,
    Shoreline,
    TimeSeries,
    CompareInputs,
    SimulateSurvey,
    CheckEngine,
)
