"""
Check everything: ``python3 tests/run.py [--fast] [-- PYTEST_ARGUMENT ...]``.

Prepares the checkout as ``orchestrate.py`` does, with what the tests need, then runs every step
whatever became of the ones before. The exit code is 0 only if all of them passed.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

import orchestrate  # noqa: E402 - found only now

PACKAGES = (
    'auv_sim\tsrc/auv_sim\t(ros.ament_python)',
    'c3_station\tsrc/c3_station\t(ros.ament_python)',
    'msgs_json\tmsgs_json\t(ros.ament_python)',
    'uav_planner\tsrc/uav_planner\t(ros.ament_python)',
)
"""What ``colcon list`` prints; an invalid ``package.xml`` demotes a package to plain Python."""

NOTHING_SELECTED = 5
"""Exit code of pytest when no test matches: a marker or an argument may well leave none."""

HANGS_AFTER_S = 300
"""A test that takes longer is stopped and has failed; the slowest take about a minute."""


class Checks:
    """Runs the steps, one after another, in the environment of the workspace."""

    def __init__(self, env: dict[str, str], scratch: Path) -> None:
        self._env = env
        self._scratch = scratch
        self.failed: list[str] = []
        self.tests: Counter[str] = Counter()

    def step(self, name: str, passes: Callable[[], bool]) -> None:
        """Run one step and print how it went and how long it took."""
        print(f'=== {name}', flush=True)
        start_s = time.monotonic()
        passed = passes()
        took_s = time.monotonic() - start_s
        print(f'=== {name}: {"ok" if passed else "FAILED"} ({took_s:.1f} s)\n', flush=True)
        if not passed:
            self.failed.append(name)

    def tool(self, name: str, *arguments: str) -> bool:
        """Run a tool of the virtual environment."""
        return self._call(name, *arguments).returncode == 0

    def packages(self) -> bool:
        """Check that colcon sees the packages for what they are."""
        listed = self._call('colcon', '--log-base', '/dev/null', 'list', pipe=True).stdout
        if listed.splitlines() == list(PACKAGES):
            return True
        print(f'colcon list printed\n{listed}\nand not\n' + '\n'.join(PACKAGES))
        return False

    def pytest(self, *arguments: str) -> bool:
        """Run pytest and add up what it counts."""
        report = self._scratch / 'junit.xml'
        report.unlink(missing_ok=True)
        options = (f'--timeout={HANGS_AFTER_S}', f'--junit-xml={report}')
        code = self._call('pytest', *options, *arguments).returncode
        if report.exists():
            for suite in ElementTree.parse(report).iter('testsuite'):
                count = {key: int(suite.get(key, 0)) for key in ('tests', 'skipped')}
                failed = int(suite.get('failures', 0)) + int(suite.get('errors', 0))
                passed = count['tests'] - count['skipped'] - failed
                self.tests.update(passed=passed, failed=failed, skipped=count['skipped'])
        return code in {0, NOTHING_SELECTED}

    def _call(
        self, name: str, *arguments: str, pipe: bool = False
    ) -> subprocess.CompletedProcess[str]:
        command = [str(orchestrate.VENV / 'bin' / name), *arguments]
        output = subprocess.PIPE if pipe else None
        return subprocess.run(
            command, cwd=ROOT, env=self._env, stdout=output, text=True, check=False
        )


def run(env: dict[str, str], fast: bool, pytest_arguments: list[str], scratch: Path) -> int:
    """Run all steps, print the summary and return the exit code."""
    # Nothing of a test run stays behind: shared memory of killed processes would, logs, too.
    env = {
        **env,
        'FASTDDS_BUILTIN_TRANSPORTS': 'UDPv4',
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_LOG_DIR': str(scratch / 'ros_log'),
    }
    checks = Checks(env, scratch)
    checks.step('ruff check', lambda: checks.tool('ruff', 'check'))
    checks.step('ruff format', lambda: checks.tool('ruff', 'format', '--check'))
    checks.step('mypy', lambda: checks.tool('mypy'))
    checks.step('colcon list', checks.packages)
    without_ros = 'not ros and not slow' if fast else 'not ros'
    checks.step(
        'pytest without ROS',
        lambda: checks.pytest('-n', '2', *pytest_arguments, '-m', without_ros),
    )
    if not fast:
        # One at a time: each starts processes of its own and waits for them in real time.
        checks.step('pytest on ROS', lambda: checks.pytest(*pytest_arguments, '-m', 'ros'))

    if not checks.tests.total():
        checks.failed.append('no test was run')
    if checks.tests['skipped']:
        print(f'{checks.tests["skipped"]} skipped')
    print('{passed} passed, {failed} failed'.format_map(checks.tests))
    if checks.failed:
        print('FAILED: ' + ', '.join(checks.failed))
    return 1 if checks.failed else 0


def main() -> int:
    """Read the command line, prepare the checkout and run the steps."""
    parser = argparse.ArgumentParser(
        description='Prepare this checkout and check everything: ruff, mypy, colcon, pytest.',
        epilog='example: python3 tests/run.py --fast -- src/uav_planner -k theorem',
    )
    parser.add_argument(
        '--fast', action='store_true', help='leave out the tests marked slow and ros'
    )
    parser.add_argument(
        'pytest_arguments', nargs='*', metavar='PYTEST_ARGUMENT', help='after --, for pytest'
    )
    arguments = parser.parse_args()
    try:
        env = orchestrate.prepare(with_tests=True)
    except orchestrate.SetupError as error:
        print(error, file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix='shearwater-tests-') as scratch:
        return run(env, arguments.fast, arguments.pytest_arguments, Path(scratch))


if __name__ == '__main__':
    sys.exit(main())
