"""The file that holds a mission's key: for its owner alone, and refused if it is not."""

from __future__ import annotations

import os
import secrets
import stat
from binascii import unhexlify
from pathlib import Path

from msgs_json.authentication import KEY_MIN_BYTES

_MODES = (0o600, 0o400)
_TEXT_MAX_BYTES = 1024
"""What is longer is no key; it is not read to its end."""


def read_key(path: str) -> bytes:
    """
    Return the key in a file of hexadecimal digits.

    A symbolic link is followed, and what it leads to is judged. No error quotes what it holds.

    Raises
    ------
    ValueError
        It cannot be read, is not a regular file of ours alone, or holds no key.

    """
    try:
        return _key_in(_secret_text(path))
    except OSError as error:
        raise ValueError(f'key file {path!r}: {error.strerror}') from None
    except ValueError as error:
        raise ValueError(f'key file {path!r}: {error}') from None


def new_key() -> bytes:
    """Return a key that was drawn just now."""
    return secrets.token_bytes(KEY_MIN_BYTES)


def write_key(path: Path, key: bytes) -> None:
    """
    Write a key to a new file that only its owner may read.

    Raises
    ------
    OSError
        The file exists already, even as a link that leads nowhere, or cannot be written.

    """
    # Made with its final mode: there is no moment at which others could open it.
    file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(file, 'w', encoding='ascii') as stream:
        # An unusual umask may have taken the owner's own rights.
        os.fchmod(file, 0o600)
        stream.write(f'{key.hex()}\n')
        stream.flush()
        # A mission is resumed with its key, even after the whole machine went down.
        os.fsync(file)


def _secret_text(path: str) -> bytes:
    # A pipe is not waited for. What is judged is what was opened, whatever the name means by now.
    file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        status = os.fstat(file)
        mode = stat.S_IMODE(status.st_mode)
        if not stat.S_ISREG(status.st_mode):
            raise ValueError('is not a regular file')
        if status.st_uid != os.geteuid():
            raise ValueError(
                f'belongs to user {status.st_uid}; allowed: {os.geteuid()}, who runs this'
            )
        if mode not in _MODES:
            raise ValueError(f'has mode {mode:04o}; allowed: 0600 or 0400 (chmod 600)')
        return os.read(file, _TEXT_MAX_BYTES + 1)
    finally:
        os.close(file)


def _key_in(text: bytes) -> bytes:
    if len(text) > _TEXT_MAX_BYTES:
        raise ValueError(f'is longer than {_TEXT_MAX_BYTES} bytes')
    try:
        key = unhexlify(text.strip())
    except ValueError:
        raise ValueError('is not hexadecimal; allowed: pairs of 0-9 and a-f') from None
    if len(key) < KEY_MIN_BYTES:
        raise ValueError(
            f'holds {len(key)} bytes; allowed: at least {KEY_MIN_BYTES},'
            f' which are {2 * KEY_MIN_BYTES} hexadecimal digits'
        )
    return key
