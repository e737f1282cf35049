"""Lists of JSON objects as pandas tables whose `attrs["units"]` say what their columns are in."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas


def flat(entry: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Objects within an object as columns of their own, `reference.value`; lists stay lists."""
    row: dict[str, Any] = {}
    for key, value in entry.items():
        if isinstance(value, Mapping):
            row.update(flat(value, f"{prefix}{key}."))
        else:
            row[prefix + key] = value
    return row


def table(entries: Iterable[Mapping[str, Any]], columns: Iterable[str], units: Mapping[str, str]) -> pandas.DataFrame:
    """One row an entry; `columns` are there even where there is no entry."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError("tables need pandas: pip install 'luxproof[pandas]'") from error
    rows = [flat(entry) for entry in entries]
    further = sorted({key for row in rows for key in row} - set(columns))
    frame = pandas.DataFrame(rows, columns=[*columns, *further])
    frame.attrs["units"] = dict(units)
    return frame
