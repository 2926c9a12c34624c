"""Before leaving the field: will the photographs of a plot do, and which stations are to be flown again?"""

from fieldkit.evaluation.field_check.check import check_captures
from fieldkit.evaluation.field_check.model import CheckFinding, CheckReport, CheckSettings, StationCheck
from fieldkit.evaluation.field_check.refly import write_refly

__all__ = [
    "CheckFinding",
    "CheckReport",
    "CheckSettings",
    "StationCheck",
    "check_captures",
    "write_refly",
]
