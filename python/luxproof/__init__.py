"""luxproof from Python: run audits, read reports and photometric files as pandas tables.

Everything is asked of the program that lies beside this package; nothing is computed twice.

>>> report = luxproof.run("office.yaml", engines=["radiance", "mitsuba"])
>>> report.comparisons[["engine", "meter", "relative_deviation", "verdict"]]
>>> luxproof.photometry("lamp.ies").loc[0, "flux_lm"]
"""

from luxproof._lines import each_comparison
from luxproof._photometry import photometry
from luxproof._program import LuxproofError, program, version
from luxproof._report import Report, load, run
from luxproof._reproduce import reproduce

__all__ = ["LuxproofError", "Report", "each_comparison", "load", "photometry", "program", "reproduce", "run", "version"]
