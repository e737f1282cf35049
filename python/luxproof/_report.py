"""Reports of runs."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from luxproof._program import ask
from luxproof._tables import table

if TYPE_CHECKING:
    import pandas

_KEY = ["case", "procedure", "engine"]
#: The version of report.json that this package reads.
_REPORT_VERSION = 2


@dataclass(frozen=True)
class Report:
    """One run: `data` is report.json as it stands, the rest are views of it."""

    data: dict[str, Any] = field(repr=False)
    #: Folder of the run's files, where it was kept.
    folder: Path | None = None

    @property
    def title(self) -> str:
        return str(self.data["spec"]["title"])

    @property
    def summary(self) -> dict[str, int]:
        """How many comparisons have each verdict, and how many procedures were skipped."""
        return dict(self.data["summary"])

    @property
    def sentences(self) -> list[str]:
        """What each renderer can be trusted for, a sentence each."""
        return [sentence["text"] for sentence in self.data.get("sentences", [])]

    @property
    def comparisons(self) -> pandas.DataFrame:
        """Every reading against every reference.

        Columns: case, procedure, engine, model, meter; at_m (metres), normal; gamma_deg, c_deg (degrees); quantity, which names
        the unit of value, reference.value, reference.uncertainty (standard) and deviation: illuminance_lx or
        luminous_intensity_cd; relative_deviation and tolerance.relative (1); tolerance.absolute (as value); verdict; diagnosis.
        """
        columns = [*_KEY, "model", "meter", "at_m", "normal", "gamma_deg", "c_deg", "quantity", "value", "std_error",
                   "reference.value", "reference.uncertainty", "reference.basis", "deviation", "relative_deviation",
                   "tolerance.relative", "tolerance.absolute", "verdict", "diagnosis"]
        lux = "lx or cd, as quantity says"
        units = {"at_m": "m", "gamma_deg": "deg", "c_deg": "deg", "value": lux, "std_error": lux, "reference.value": lux,
                 "reference.uncertainty": lux, "deviation": lux, "relative_deviation": "1", "tolerance.relative": "1",
                 "tolerance.absolute": lux}
        return table(self.data["comparisons"], columns, units)

    @property
    def readings(self) -> pandas.DataFrame:
        """Every reading of every engine, once.

        Columns: case, procedure, engine, model, meter, quantity; value, std_error (one standard error) and error_bound in lux or
        candela, as quantity says.
        """
        columns = [*_KEY, "model", "meter", "quantity", "value", "std_error", "error_bound"]
        lux = "lx or cd, as quantity says"
        return table(self.data["readings"], columns, {"value": lux, "std_error": lux, "error_bound": lux})

    @property
    def statistics(self) -> pandas.DataFrame:
        """What sets of meters come to, engine by engine.

        Columns: case, procedure, engine, set, meters (how many); mean.value, minimum.value and maximum.value in lux;
        uniformity.value, minimum over mean, and diversity.value, minimum over maximum (1); each with std_error and error_bound
        likewise. Where they are judged, agreement.mean.deviation, .expanded, .allowed and .verdict, and so of the others.
        """
        parts = ["mean", "minimum", "maximum", "uniformity", "diversity"]
        columns = [*_KEY, "set", "meters", *(f"{part}.value" for part in parts)]
        units = {f"{part}.{of}": "1" if part in ("uniformity", "diversity") else "lx" for part in parts for of in ("value", "std_error", "error_bound")}
        return table(self.data.get("statistics", []), columns, units)

    @property
    def ratios(self) -> pandas.DataFrame:
        """What cases that a spec compares are to each other, a row a meter.

        Columns: before, after (cases), procedure, engine, set, basis, meter; ratio.value, after over before (1), with
        ratio.std_error and ratio.error_bound; agreement.deviation, .expanded, .allowed and .verdict; errors_cancel. The means of sets
        are in `data["ratios"]`.
        """
        own = ["before", "after", "procedure", "engine", "set", "basis"]
        rows = [{**{key: of[key] for key in own}, **meter} for of in self.data.get("ratios", []) for meter in of["meters"]]
        return table(rows, [*own, "meter", "ratio.value", "errors_cancel"], {"ratio.value": "1"})

    @property
    def bias(self) -> pandas.DataFrame:
        """Mean deviations: case, procedure, engine, basis, readings; mean, low and high relative (1); p_value (1)."""
        columns = [*_KEY, "basis", "readings", "mean", "low", "high", "p_value"]
        return table(self.data.get("bias", []), columns, {"mean": "1", "low": "1", "high": "1", "p_value": "1"})


def load(path: str | os.PathLike[str]) -> Report:
    """The report of a finished run: its report.json, or the folder that holds it."""
    file = Path(path)
    file = file / "report.json" if file.is_dir() else file
    data = json.loads(file.read_text(encoding="utf-8"))
    if not isinstance(data, dict) or "luxproof" not in data or "comparisons" not in data:
        raise ValueError(f"{file} is no report of luxproof")
    if data["luxproof"] != _REPORT_VERSION:
        raise ValueError(
            f"{file} is a report of version {data['luxproof']}; this package reads version {_REPORT_VERSION}: run its spec again"
        )
    return Report(data, file.parent)


def run(
    *specs: str | os.PathLike[str],
    engines: Sequence[str] = (),
    procedures: Sequence[str] = (),
    out: str | os.PathLike[str] | None = None,
    seed: int | None = None,
    options: Sequence[str] = (),
) -> Report:
    """Audits specs, as `luxproof run` does, and gives the report, whatever its verdicts.

    `options` are further options of the program, such as `["--install"]`. Without `out` the run's files are not kept.
    Raises LuxproofError where the program refuses its input.
    """
    if not specs:
        raise TypeError("run() needs a spec at least")
    with tempfile.TemporaryDirectory(prefix="luxproof-") as temporary:
        folder = Path(temporary if out is None else out)
        arguments = ["run", *(os.fspath(spec) for spec in specs), "--out", os.fspath(folder), "--format", "json"]
        arguments += ["--engines", ",".join(engines)] if engines else []
        arguments += ["--procedures", ",".join(procedures)] if procedures else []
        arguments += ["--seed", str(seed)] if seed is not None else []
        ask([*arguments, *options])
        data = load(folder).data
    return Report(data, None if out is None else folder)
