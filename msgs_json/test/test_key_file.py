from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import pytest

from msgs_json.authentication import KEY_MIN_BYTES, Authenticator
from msgs_json.key_file import new_key, read_key, write_key

KEY = bytes(range(KEY_MIN_BYTES))
HEX = KEY.hex()


@pytest.fixture
def key_file(tmp_path: Path) -> Path:
    """Return a key file that is as it should be."""
    path = tmp_path / 'mission.key'
    path.write_text(f'{HEX}\n')
    path.chmod(0o600)
    return path


@pytest.fixture(params=[0o000, 0o022, 0o777], ids='umask-{:03o}'.format)
def umask(request: pytest.FixtureRequest) -> Iterator[int]:
    """Set a umask that takes nothing, the usual, or everything from a new file's mode."""
    before = os.umask(request.param)
    yield request.param
    os.umask(before)


@pytest.mark.usefixtures('umask')
def test_a_new_key_is_for_its_owner_alone(tmp_path: Path) -> None:
    path = tmp_path / 'mission.key'
    write_key(path, KEY)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert read_key(str(path)) == KEY


def test_a_new_key_is_never_open_to_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = []
    really_open = os.open

    def watched_open(path: Path, flags: int, mode: int = 0o777) -> int:
        opened = really_open(path, flags, mode)
        made.append(stat.S_IMODE(os.fstat(opened).st_mode))
        return opened

    monkeypatch.setattr(os, 'open', watched_open)
    before = os.umask(0)
    try:
        write_key(tmp_path / 'mission.key', KEY)
    finally:
        os.umask(before)
    assert made == [0o600]


def test_no_two_keys_are_the_same() -> None:
    keys = {new_key() for _ in range(10)}
    assert len(keys) == 10
    assert {len(key) for key in keys} == {KEY_MIN_BYTES}


def test_a_key_is_not_written_over(key_file: Path) -> None:
    with pytest.raises(FileExistsError):
        write_key(key_file, KEY)
    assert read_key(str(key_file)).hex() == HEX


def test_a_key_is_not_written_through_a_link(tmp_path: Path) -> None:
    (tmp_path / 'link').symlink_to(tmp_path / 'elsewhere')
    with pytest.raises(FileExistsError):
        write_key(tmp_path / 'link', KEY)
    assert not (tmp_path / 'elsewhere').exists()


@pytest.mark.parametrize(
    'text',
    [HEX, f'{HEX}\n', f'  {HEX}\r\n', HEX.upper(), HEX * 16],
    ids=['bare', 'a line', 'white space', 'capitals', 'long'],
)
@pytest.mark.parametrize('mode', [0o600, 0o400])
def test_the_key_is_what_the_digits_say(key_file: Path, text: str, mode: int) -> None:
    key_file.write_text(text)
    key_file.chmod(mode)
    key = read_key(str(key_file))
    assert key == bytes.fromhex(text)
    Authenticator(key)


@pytest.mark.parametrize(
    ('text', 'problem'),
    [
        pytest.param('', 'holds 0 bytes; allowed: at least 32', id='empty'),
        pytest.param(HEX[:-2], 'holds 31 bytes; allowed: at least 32', id='short'),
        pytest.param(HEX + 'a', 'is not hexadecimal', id='odd'),
        pytest.param(HEX + 'xy', 'is not hexadecimal', id='other letters'),
        pytest.param(f'0x{HEX}', 'is not hexadecimal', id='prefix'),
        pytest.param(f'{HEX}\n{HEX}', 'is not hexadecimal', id='two lines'),
        pytest.param('\u0660' * 64, 'is not hexadecimal', id='digits of another script'),
        pytest.param('00' * 513, 'is longer than 1024 bytes', id='long'),
    ],
)
def test_what_is_no_key_is_refused(key_file: Path, text: str, problem: str) -> None:
    key_file.write_text(text)
    with pytest.raises(ValueError, match=problem) as error:
        read_key(str(key_file))
    assert str(key_file) in str(error.value)
    assert HEX[:8] not in str(error.value)


@pytest.mark.parametrize('mode', [0o640, 0o604, 0o644, 0o660, 0o700, 0o666, 0o4600, 0o200])
def test_a_key_that_is_open_to_others_is_refused(key_file: Path, mode: int) -> None:
    key_file.chmod(mode)
    # 0200: who may not read the file is told so, except root, who always may.
    problem = rf'has mode {mode:04o}; allowed: 0600 or 0400|Permission denied'
    with pytest.raises(ValueError, match=problem):
        read_key(str(key_file))


def test_a_key_of_somebody_else_is_refused(
    key_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    owner = key_file.stat().st_uid
    monkeypatch.setattr(os, 'geteuid', lambda: owner + 1)
    with pytest.raises(ValueError, match=f'belongs to user {owner}; allowed: {owner + 1}'):
        read_key(str(key_file))


def test_a_link_is_judged_by_what_it_leads_to(key_file: Path) -> None:
    link = key_file.with_name('link')
    link.symlink_to(key_file)
    assert read_key(str(link)).hex() == HEX
    key_file.chmod(0o640)
    with pytest.raises(ValueError, match=r'has mode 0640'):
        read_key(str(link))


def test_what_is_no_file_is_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / 'pipe', 0o600)
    for path in (str(tmp_path), str(tmp_path / 'pipe'), '/dev/zero'):
        with pytest.raises(ValueError, match=f"key file '{path}': is not a regular file"):
            read_key(path)


@pytest.mark.parametrize(
    ('name', 'problem'),
    [('none', 'No such file or directory'), ('', 'No such file'), ('a\0b', 'embedded null byte')],
    ids=['missing', 'no name', 'no possible name'],
)
def test_what_is_not_there_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, problem: str
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match=f'key file .*: {problem}') as error:
        read_key(name)
    assert repr(name) in str(error.value)
