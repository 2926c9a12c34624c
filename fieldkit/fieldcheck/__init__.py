"""Before leaving the field: will the photographs of a plot do, and which stations are to be flown again?"""

from fieldkit.fieldcheck.model import CheckReport, CheckSettings, StationCheck
from fieldkit.fieldcheck.refly import write_refly

__all__ = ["CheckReport", "CheckSettings", "StationCheck", "write_refly"]
