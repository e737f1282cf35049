"""The comparisons of a long report, one at a time: of a million the list alone takes several GB in Python."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_SCHEMA = "luxproof comparisons 2"
#: What of report.json holds its checksum, which is one of the first things that it says.
_HEAD = 4096


def each_comparison(path: str | os.PathLike[str]) -> Iterator[dict[str, Any]]:
    """Every comparison of a run's folder, or of its `comparisons.jsonl`, in the order of report.json.

    A folder without `comparisons.jsonl` holds a short report, whose report.json is read. Raises ValueError where lines are missing, where they
    are damaged, or where they are those of another report than the one beside them: at the end, when all that is there was given out.
    """
    file = Path(path)
    if file.is_dir():
        lines = file / "comparisons.jsonl"
        if not lines.exists():
            from luxproof._report import load

            yield from load(file).data["comparisons"]
            return
        file = lines
    with file.open("rb") as text:
        head = _head(file, text.readline())
        read, sha256 = 0, hashlib.sha256()
        for line in text:
            sha256.update(line)
            if not line.endswith(b"\n"):
                break
            read += 1
            yield json.loads(line)
    if read != head["comparisons"]:
        raise ValueError(f"{file} ends early or was edited: {read} comparisons of {head['comparisons']}; {_AGAIN}")
    if sha256.hexdigest() != head["sha256"]:
        raise ValueError(f"{file} is damaged or was edited: its lines are not those that were written; {_AGAIN}")


_AGAIN = "run its spec again, finished readings are in the cache"


def _head(file: Path, line: bytes) -> dict[str, Any]:
    try:
        head = json.loads(line)
    except ValueError:
        head = None
    if not isinstance(head, dict) or head.get("schema") != _SCHEMA:
        raise ValueError(f"{file} does not begin as `{_SCHEMA}` does")
    report = file.with_name("report.json")
    if report.exists():
        with report.open("rb") as text:
            found = re.search(rb'"checksum":\s*"([0-9a-f]{64})"', text.read(_HEAD))
        if found is None or found[1].decode() != head["report"]:
            raise ValueError(f"{file} is of another report than {report.name} beside it; {_AGAIN}")
    return head
