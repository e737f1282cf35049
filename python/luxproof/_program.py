"""Where the program is, and how it is asked."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Sequence
from pathlib import Path

#: What the program's exit code says of a run; 2 is an error and raised.
PASSED, FAILED, USAGE, ENGINE, UNDECIDED = 0, 1, 2, 3, 4


class LuxproofError(RuntimeError):
    """The program refused its input; the message is what it said, each fault with file, line and column."""


def program() -> str:
    """The path of the program: the one that LUXPROOF names, the one of this installation, or the one on PATH."""
    named = os.environ.get("LUXPROOF")
    if named:
        return named
    name = "luxproof" + (sysconfig.get_config_var("EXE") or "")
    folders: list[str | Path] = [sysconfig.get_path("scripts"), sysconfig.get_path("scripts", f"{os.name}_user"), Path(sys.executable).parent]
    for folder in folders:
        path = Path(folder) / name
        if path.is_file():
            return str(path)
    found = shutil.which(name)
    if found is None:
        raise LuxproofError("the program `luxproof` is not installed beside this package and not on PATH")
    return found


def ask(arguments: Sequence[str]) -> subprocess.CompletedProcess[str]:
    """Runs the program; what it prints is kept, and exit code 2 raised."""
    answer = subprocess.run([program(), *arguments], capture_output=True, text=True, check=False, env={**os.environ, "NO_COLOR": "1"})
    if answer.returncode == USAGE or answer.returncode < 0 or answer.returncode > UNDECIDED:
        raise LuxproofError(answer.stderr.strip() or f"luxproof ended with {answer.returncode}")
    return answer


def version() -> str:
    """The program's version, with its commit where that is known."""
    return ask(["--version"]).stdout.removeprefix("luxproof ").strip()
