"""Runs and papers made again."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from typing import TYPE_CHECKING

from luxproof._program import ask
from luxproof._tables import table

if TYPE_CHECKING:
    import pandas


def reproduce(what: str | os.PathLike[str], *, out: str | os.PathLike[str], options: Sequence[str] = ()) -> pandas.DataFrame:
    """Makes a paper's tables again, or the run of a bundle, as `luxproof reproduce` does; the new run's files lie in `out`.

    A paper's tables (YAML) have one row for each printed cell: table, column, place, printed; rounding, computed and uncertainty (half width of
    its interval) in `unit`; standing: reproduced, not_reproduced, undecided, not_read; fits_table: whether the cell
    agrees with the other columns of its own table. A bundle has one row for each case, procedure and engine:
    outcome, comparisons, differences, notes. Raises LuxproofError where it is no bundle or no table, or the bundle was changed.
    """
    answer = ask(["reproduce", os.fspath(what), "--out", os.fspath(out), "--format", "json", *options])
    found = json.loads(answer.stdout)
    if isinstance(found, dict):
        return table(found["rows"], ["case", "procedure", "engine", "outcome", "comparisons", "differences", "notes"], {})
    columns = ["table", "column", "place", "printed", "rounding", "unit", "engine", "model", "computed", "uncertainty", "standing", "fits_table", "note"]
    lux = "lx or cd, as unit says"
    return table(found, columns, {"rounding": lux, "computed": lux, "uncertainty": lux})
