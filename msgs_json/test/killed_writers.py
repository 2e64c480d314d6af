"""
Kills processes that write to a store, one after the other, and looks at what each has left.

Run as a script with folder and number of kills, so that the writers fork from a small process.
"""

from __future__ import annotations

import os
import random
import signal
import sys
import time
from pathlib import Path

from msgs_json.sqlite_store import SqliteStore

NUMBER_BYTES = 8


def write_numbers(path: Path, said: int) -> None:
    """Count on from what is stored, for ever, saying each number once it is committed."""
    store = SqliteStore(path, identity='counter')
    number = store.load('count', int).get('left', -1)
    while True:
        number += 1
        store.put('count', 'left', number)
        store.put('number', str(number), number)
        store.drop('number', str(number - 20))
        store.put('count', 'right', number)
        store.commit()
        os.write(said, number.to_bytes(NUMBER_BYTES))


def kill_a_writer(path: Path, after_s: float) -> int:
    """Return the last number that a writer said before it was killed; -1 if it said none."""
    hear, say = os.pipe()
    pid = os.fork()
    if pid == 0:
        try:
            write_numbers(path, say)
        finally:
            os._exit(1)
    os.close(say)
    time.sleep(after_s)
    os.kill(pid, signal.SIGKILL)
    _, status = os.waitpid(pid, 0)
    assert os.WIFSIGNALED(status), 'the writer ended by itself'
    with os.fdopen(hear, 'rb') as pipe:
        said = pipe.read()
    return int.from_bytes(said[-NUMBER_BYTES:]) if said else -1


def look(path: Path, said: int) -> int:
    """Return the last number stored, which must be the one that was said or the next one."""
    store = SqliteStore(path, identity='counter')
    counts = store.load('count', int)
    numbers = store.load('number', int)
    store.close()
    assert set(counts) in (set(), {'left', 'right'}), f'a part of a commit: {counts}'
    last = counts.get('left', -1)
    assert counts.get('right', -1) == last, f'a part of a commit: {counts}'
    assert last in (said, said + 1), f'{said} was said, {last} is stored'
    expected = range(max(0, last - 19), last + 1)
    assert sorted(numbers.values()) == list(expected), f'{last}: {sorted(numbers.values())}'
    return last


def main(path: Path, kills: int) -> None:
    rng = random.Random(5)
    last = -1
    for _ in range(kills):
        said = kill_a_writer(path, rng.uniform(0, 0.03))
        last = look(path, max(said, last))
    sys.stdout.write(f'{last}\n')


if __name__ == '__main__':
    main(Path(sys.argv[1]), int(sys.argv[2]))
