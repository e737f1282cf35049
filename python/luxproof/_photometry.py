"""Photometric files."""

from __future__ import annotations

import json
import os
from typing import TYPE_CHECKING

from luxproof._program import ask
from luxproof._tables import table

if TYPE_CHECKING:
    import pandas


def photometry(*files: str | os.PathLike[str]) -> pandas.DataFrame:
    """What photometric files say, one row a file, as `luxproof photometry --json` does.

    Columns: file, format; flux_lm, flux_up_lm, flux_down_lm (lumen); max_cd (candela); symmetry; lint, a list of findings with
    code, line and message. Raises LuxproofError where a file cannot be read.
    """
    if not files:
        raise TypeError("photometry() needs a file at least")
    answer = ask(["photometry", "--json", *(os.fspath(file) for file in files)])
    columns = ["file", "format", "flux_lm", "flux_up_lm", "flux_down_lm", "max_cd", "symmetry", "lint"]
    units = {"flux_lm": "lm", "flux_up_lm": "lm", "flux_down_lm": "lm", "max_cd": "cd"}
    return table(json.loads(answer.stdout), columns, units)
