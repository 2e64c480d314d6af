"""Compiled code is kept on disk, and never stands in the way of what the file has become."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

SOURCE = """
from typing import NamedTuple
from uav_planner.compilation import compiled

class {name}(NamedTuple):
    moves: int

@compiled
def ticks(leg):
    return leg.moves * {ticks_per_move}
"""


def write(folder: Path, name: str, ticks_per_move: int) -> None:
    """Write the file with a class of some name."""
    source = SOURCE.format(name=name, ticks_per_move=ticks_per_move)
    (folder / 'survey.py').write_text(source)


def ticks_of_three_moves(folder: Path, name: str) -> int:
    """Return what a fresh process makes of the file; what it compiles is kept beside it."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith('NUMBA_')}
    process = subprocess.run(
        [sys.executable, '-B', '-c', f'import survey; print(survey.ticks(survey.{name}(3)))'],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert process.returncode == 0, process.stderr
    return int(process.stdout)


def kept(folder: Path) -> dict[str, int]:
    """Return the compiled files that are kept and when each was written."""
    return {path.name: path.stat().st_mtime_ns for path in folder.rglob('*.nb?')}


def test_what_was_compiled_is_kept_until_its_file_changes(tmp_path: Path) -> None:
    write(tmp_path, 'Leg', 10)
    assert ticks_of_three_moves(tmp_path, 'Leg') == 30
    compiled_once = kept(tmp_path)
    assert compiled_once
    assert ticks_of_three_moves(tmp_path, 'Leg') == 30
    assert kept(tmp_path) == compiled_once
    write(tmp_path, 'SurveyLeg', 20)  # what is kept knows a class that is gone
    assert ticks_of_three_moves(tmp_path, 'SurveyLeg') == 60
    assert kept(tmp_path) != compiled_once
