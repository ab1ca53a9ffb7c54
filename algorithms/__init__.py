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
from .simulatesurvey import SimulateSurvey
from .surveylayers import SurveyLayers
from .tiepoints import TiePoints

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
    CompareInputs,
    SimulateSurvey,
    CheckEngine,
)
