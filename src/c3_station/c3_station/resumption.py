"""A run whose processes have all ended before its mission was over: what is left of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import msgspec

from c3_station.bag import BagError, BagReader, salvage_bag
from c3_station.program import PROGRAM
from c3_station.run_folder import RunFolder, Way
from c3_station.scenario import Scenario
from c3_station.scenario_files import parse_scenario


@dataclass(frozen=True, slots=True, kw_only=True)
class Resumption:
    """What is needed to go on."""

    folder: RunFolder
    scenario: Scenario
    way: Way


def resumption(out: Path) -> Resumption:
    """
    Return what is left of a run.

    Raises
    ------
    ValueError
        There is no such run, or it cannot be resumed; the text says why.

    """
    folder = RunFolder(out)
    if not out.is_dir():
        raise ValueError(f'{out}: there is no such folder')
    try:
        scenario = parse_scenario(folder.scenario.read_text(encoding='utf-8'))
        way = msgspec.json.decode(folder.way.read_bytes(), type=Way)
    except FileNotFoundError as error:
        missing = Path(error.filename).name
        raise ValueError(f'{out}: is not the folder of a run: there is no {missing}') from None
    except msgspec.MsgspecError as error:
        raise ValueError(f'{folder.way}: {error}') from None
    if not way.ros:
        raise ValueError(
            f'{out}: was flown in one process, whose agents keep what they know in memory;'
            ' fly it again'
        )
    if _is_over(folder):
        raise ValueError(f'{out}: its mission is over; see it with: {PROGRAM} report {out}')
    return Resumption(folder=folder, scenario=scenario, way=way)


def set_bag_aside(folder: RunFolder) -> Path | None:
    """
    Make room for a new bag; return what was recorded so far, None where that is nothing.

    A recorder that is killed while it copies leaves a shorter bag than it began with: the longest
    one counts.
    """
    if folder.bag.exists():
        folder.bag.rename(folder.path / f'bag_before_{1 + len(bags_aside(folder))}')
    lengths = {path: _messages(path) for path in bags_aside(folder)}
    longest = max(lengths, key=lambda path: lengths[path], default=None)
    return longest if longest is not None and lengths[longest] else None


def bags_aside(folder: RunFolder) -> list[Path]:
    """Return the bags that `set_bag_aside` has made room for."""
    return sorted(folder.path.glob('bag_before_*'))


def _messages(bag: Path) -> int:
    try:
        return len(salvage_bag(bag).messages)
    except BagError:
        return 0


def _is_over(folder: RunFolder) -> bool:
    try:
        with BagReader(folder.bag) as reader:
            return reader.facts.complete
    except BagError:
        return False
