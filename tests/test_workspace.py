"""The workspace itself: packages, what imports what, pinned requirements, the set-up."""

import ast
import contextlib
import json
import os
import re
import runpy
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from catkin_pkg.package import Package, parse_package
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import orchestrate

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Room:
    """A package and what it may know of the others (the table of rooms in the design)."""

    name: str
    folder: str
    may_import: frozenset[str] = frozenset()
    executables: frozenset[str] = frozenset()
    drivers: frozenset[str] = frozenset()

    @property
    def path(self) -> Path:
        return ROOT / self.folder

    def modules(self) -> list[Path]:
        return sorted((self.path / self.name).rglob('*.py'))

    def tests(self) -> list[Path]:
        return sorted((self.path / 'test').rglob('*.py'))


ROOMS = (
    Room(name='msgs_json', folder='msgs_json'),
    Room(
        name='uav_planner',
        folder='src/uav_planner',
        may_import=frozenset({'msgs_json'}),
        executables=frozenset({'uav'}),
        drivers=frozenset({'kinematic', 'topics'}),
    ),
    Room(
        name='auv_sim',
        folder='src/auv_sim',
        may_import=frozenset({'msgs_json'}),
        executables=frozenset({'auv', 'fleet', 'world'}),
        drivers=frozenset({'kinematic', 'topics'}),
    ),
    Room(
        name='c3_station',
        folder='src/c3_station',
        may_import=frozenset({'msgs_json', 'uav_planner', 'auv_sim'}),
        executables=frozenset({'c3', 'recorder'}),
    ),
)

each_room = pytest.mark.parametrize('room', ROOMS, ids=lambda room: room.name)

ROSDEP_KEYS = {
    'hypothesis': 'python3-hypothesis',
    'jinja2': 'python3-jinja2',
    'jsonschema': 'python3-jsonschema',
    'matplotlib': 'python3-matplotlib',
    'numba': 'python3-numba',
    'numpy': 'python3-numpy',
    'pytest': 'python3-pytest',
    'rich': 'python3-rich',
    'rosbags': 'python3-rosbags-pip',
    'scipy': 'python3-scipy',
    'yaml': 'python3-yaml',
}
"""How ``package.xml`` names what is not a ROS package."""

WITHOUT_ROSDEP_KEY = {'distributed', 'mcap', 'mcap_ros2', 'msgspec'}

ROS_TYPE = re.compile(r'([a-z][a-z0-9_]*)/(?:msg|srv)/[A-Z]\w*')


def imported(files: Iterable[Path]) -> set[str]:
    """Return the packages outside the standard library that files import or take types from."""
    names: set[str] = set()
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
            match node:
                case ast.Import():
                    names.update(alias.name.partition('.')[0] for alias in node.names)
                case ast.ImportFrom(module=str(module), level=0):
                    names.add(module.partition('.')[0])
                case ast.Constant(value=str(text)) if ros_type := ROS_TYPE.fullmatch(text):
                    names.add(ros_type[1])
    return names - sys.stdlib_module_names


def keys(names: set[str]) -> set[str]:
    return {ROSDEP_KEYS.get(name, name) for name in names - WITHOUT_ROSDEP_KEY}


def manifest(room: Room) -> Package:
    warnings: list[str] = []
    package = parse_package(str(room.path / 'package.xml'), warnings=warnings)
    assert warnings == []
    return package


def setup_arguments(room: Room) -> dict[str, Any]:
    """Return what a package's ``setup.py`` tells setuptools."""
    with mock.patch('setuptools.setup') as setup, contextlib.chdir(room.path):
        runpy.run_path('setup.py')
    return dict(setup.call_args.kwargs)


def entry_points(room: Room) -> Iterator[tuple[str, str, str, str]]:
    """Yield ``(group, name, module, function)``."""
    for group, lines in setup_arguments(room).get('entry_points', {}).items():
        for line in lines:
            name, module, function = re.fullmatch(r'(\w+) = ([\w.]+):(\w+)', line).groups()  # type: ignore[union-attr]
            yield group, name, module, function


# --- packages ---------------------------------------------------------------------------------


@each_room
def test_the_manifest_is_complete_and_valid(room: Room) -> None:
    package = manifest(room)
    assert package.package_format == 3
    assert package.name == room.name
    assert len(package.description.split()) >= 15
    assert package.licenses == ['Apache-2.0']
    assert [person.email for person in package.maintainers] == ['shearwater@example.org']
    assert [export.content for export in package.exports] == ['ament_python']


@each_room
def test_setup_py_says_the_same_as_the_manifest(room: Room) -> None:
    package, setup = manifest(room), setup_arguments(room)
    assert (setup['name'], setup['version']) == (package.name, package.version)
    assert setup['license'] == package.licenses[0]
    assert setup['maintainer'] == package.maintainers[0].name
    assert setup['maintainer_email'] == package.maintainers[0].email
    installed = [source for _, sources in setup['data_files'] for source in sources]
    assert installed == [f'resource/{room.name}', 'package.xml']
    assert all((room.path / source).is_file() for source in installed)


@each_room
def test_the_declared_dependencies_are_the_imported_ones(room: Room) -> None:
    package = manifest(room)
    needed = keys(imported(room.modules()) - {room.name})
    assert {depend.name for depend in package.exec_depends} == needed
    siblings = {path.stem for path in room.tests()}
    for_tests = keys(imported(room.tests()) - {room.name} - siblings) | {'python3-pytest'}
    assert {depend.name for depend in package.test_depends} == for_tests - needed


@each_room
def test_nothing_imports_upward(room: Room) -> None:
    above = {other.name for other in ROOMS} - room.may_import - {room.name}
    offenders = {
        str(path.relative_to(ROOT)): found
        for path in [*room.modules(), *room.tests()]
        if (found := imported([path]) & above)
    }
    assert offenders == {}


@each_room
def test_every_entry_point_leads_to_a_function(room: Room) -> None:
    for group, name, module, function in entry_points(room):
        path = room.path / Path(*module.split('.')).with_suffix('.py')
        assert path.is_file(), f'{group} {name}: no {path.relative_to(ROOT)}'
        body = ast.parse(path.read_text(encoding='utf-8')).body
        functions = {node.name for node in body if isinstance(node, ast.FunctionDef)}
        assert function in functions, f'{group} {name}: no {function}() in {module}'


@each_room
def test_executables_and_drivers_have_their_names(room: Room) -> None:
    points = list(entry_points(room))
    assert {name for group, name, *_ in points if group == 'console_scripts'} == room.executables
    assert {name for group, name, *_ in points if group == f'{room.name}.drivers'} == room.drivers


@each_room
def test_package_data_is_what_lies_beside_the_modules(room: Room) -> None:
    [(package, patterns)] = setup_arguments(room)['package_data'].items()
    folder = room.path / package
    found = {pattern: set(folder.glob(pattern)) for pattern in patterns}
    assert [pattern for pattern, files in found.items() if not files] == []
    beside = {
        path
        for path in folder.rglob('*')
        if path.is_file() and path.suffix != '.py' and path.parent.name != '__pycache__'
    }
    assert beside == set().union(*found.values())


def test_colcon_meta_names_every_package_and_no_other() -> None:
    meta = json.loads((ROOT / 'colcon.meta').read_text(encoding='utf-8'))
    assert set(meta) == {'names'}
    assert set(meta['names']) == {room.name for room in ROOMS}


def test_the_root_is_no_package() -> None:
    # colcon would take the whole workspace for it and look no further.
    assert not (ROOT / 'setup.py').exists()
    assert not (ROOT / 'package.xml').exists()


def test_the_licence_and_the_entry_of_continuous_integration_are_in_place() -> None:
    assert 'Apache License' in (ROOT / 'LICENSE').read_text(encoding='utf-8')
    ci = ROOT / '.ci' / 'run'
    assert os.access(ci, os.X_OK)
    assert ci.read_text(encoding='utf-8').splitlines()[-1] == 'exec python3 tests/run.py'


# --- requirements -----------------------------------------------------------------------------


def pins() -> list[Requirement]:
    names = (orchestrate.RUNTIME, orchestrate.TESTS)
    return [Requirement(line) for name in names for line in orchestrate.requirements(name, False)]


def test_every_requirement_is_pinned_once() -> None:
    loose = [str(pin) for pin in pins() if not re.fullmatch(r'==[\w.]+', str(pin.specifier))]
    assert loose == []
    names = [canonicalize_name(pin.name) for pin in pins()]
    assert len(names) == len(set(names))


def test_the_requirements_name_everything_below_them() -> None:
    pinned = {canonicalize_name(pin.name): pin for pin in pins()}
    if 'ROS_DISTRO' in os.environ:  # these come with the installed ROS
        pinned = {name: pin for name, pin in pinned.items() if not name.startswith('ros-')}
    missing = []
    for pin in pinned.values():
        for line in metadata.requires(pin.name) or []:
            needed = Requirement(line)
            extras = pin.extras or {''}
            if needed.marker and not any(needed.marker.evaluate({'extra': e}) for e in extras):
                continue
            found = pinned.get(canonicalize_name(needed.name))
            version = str(found.specifier).removeprefix('==') if found else None
            if version is None or not needed.specifier.contains(version):
                missing.append(f'{pin.name} needs {needed}')
    assert missing == []


def test_a_ros_that_is_installed_replaces_the_wheels() -> None:
    wheels = orchestrate.requirements(orchestrate.RUNTIME, system_ros=False)
    system = orchestrate.requirements(orchestrate.RUNTIME, system_ros=True)
    assert [pin for pin in wheels if pin not in system]
    assert not [pin for pin in system if pin.startswith('ros-')]
    assert any(pin.startswith('rosbags==') for pin in system)


# --- set-up -----------------------------------------------------------------------------------

WHEELS = {'system_ros': False, 'workspace_paths': {'PYTHONPATH': '/ws/a:/ws/b'}}
SYSTEM = {**WHEELS, 'system_ros': True}


def test_the_environment_is_that_of_the_workspace() -> None:
    env = orchestrate.environment(WHEELS, {'PATH': '/bin', 'PYTHONPATH': '/driver', 'HOME': '/h'})
    assert env == {
        'HOME': '/h',
        'PATH': f'{orchestrate.VENV}/bin:/bin',
        'PYTHONPATH': '/ws/a:/ws/b:/driver',
        'AMENT_PREFIX_PATH': str(orchestrate.VENV),
        'VIRTUAL_ENV': str(orchestrate.VENV),
    }
    again = orchestrate.environment(WHEELS, env)
    assert again['AMENT_PREFIX_PATH'] == env['AMENT_PREFIX_PATH']


def test_libraries_of_another_environment_are_not_inherited(tmp_path: Path) -> None:
    (tmp_path / 'pyvenv.cfg').touch()
    libraries = [f'{tmp_path}/lib', f'{tmp_path}/lib/site-packages/ros_rcl.libs', '/opt/cuda']
    inherited = {
        '_ROS_WHEELS_BOOTSTRAP_COMPLETE': '1',
        'LD_LIBRARY_PATH': ':'.join(libraries),
    }
    env = orchestrate.environment(WHEELS, inherited)
    assert '_ROS_WHEELS_BOOTSTRAP_COMPLETE' not in env
    assert env['LD_LIBRARY_PATH'] == '/opt/cuda'


def sourced(distro: str) -> dict[str, str]:
    return {
        'ROS_DISTRO': distro,
        'AMENT_PREFIX_PATH': '/opt/ros/prefix',
        'PYTHONPATH': '/opt/ros/python',
        'LD_LIBRARY_PATH': '/opt/ros/lib',
        'RMW_IMPLEMENTATION': 'rmw_cyclonedds_cpp',
    }


def test_a_sourced_ros_that_does_not_serve_is_left_aside() -> None:
    env = orchestrate.environment(WHEELS, sourced('humble'))
    assert not [value for value in env.values() if '/opt/ros' in value]
    assert not {'RMW_IMPLEMENTATION', 'LD_LIBRARY_PATH', 'ROS_DISTRO'} & env.keys()


def test_a_sourced_jazzy_stays_below_the_workspace() -> None:
    env = orchestrate.environment(SYSTEM, sourced('jazzy'))
    assert env['PYTHONPATH'] == '/ws/a:/ws/b:/opt/ros/python'
    assert {**sourced('jazzy'), 'PYTHONPATH': env['PYTHONPATH']}.items() <= env.items()


def test_an_old_python_is_told_what_to_do() -> None:
    source = (ROOT / 'orchestrate.py').read_text(encoding='utf-8')
    ast.parse(source, feature_version=(3, 6))  # else it would say SyntaxError
    pretend = (
        'import runpy, sys; sys.version_info = (3, 10, 13, "final", 0); '
        'runpy.run_path("orchestrate.py", run_name="__main__")'
    )
    start = subprocess.run(
        [sys.executable, '-c', pretend], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert start.returncode == 2
    assert 'this is Python 3.10' in start.stderr
    assert 'Traceback' not in start.stderr


@pytest.mark.slow
def test_a_failing_installation_is_explained_and_taken_up_again(tmp_path: Path) -> None:
    source = ROOT / 'orchestrate.py'
    (tmp_path / source.name).write_bytes(source.read_bytes())
    (tmp_path / 'colcon.meta').touch()
    (tmp_path / orchestrate.RUNTIME).write_text('# nowhere\nno-such-package==0\n')
    for steps in (['[1/3]', '[2/3]'], ['[2/3]']):
        start = subprocess.run(
            [sys.executable, source.name],
            cwd=tmp_path,
            env={**os.environ, 'PIP_NO_INDEX': '1'},
            capture_output=True,
            text=True,
            check=False,
        )
        assert start.returncode == 2
        assert re.findall(r'^\[./3\]', start.stderr, re.MULTILINE) == steps
        assert 'No matching distribution found for no-such-package==0' in start.stderr
        assert 'Traceback' not in start.stderr
        assert start.stdout == ''


@pytest.mark.slow
@pytest.mark.skipif(
    os.environ.get('VIRTUAL_ENV') != str(orchestrate.VENV),
    reason='the checkout is prepared for sure only when tests/run.py has started this',
)
def test_a_second_start_adds_little(tmp_path: Path) -> None:
    def took_s(*command: str) -> float:
        start_s = time.monotonic()
        subprocess.run(command, cwd=tmp_path, capture_output=True, check=True)
        return time.monotonic() - start_s

    direct_s = took_s(str(orchestrate.PYTHON), '-P', '-m', 'c3_station', 'list')
    assert took_s(sys.executable, str(ROOT / 'orchestrate.py'), 'list') < direct_s + 3.0
