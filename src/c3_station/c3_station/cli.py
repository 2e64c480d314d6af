"""The command line: one sub-command, one function."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from c3_station.exit_codes import ExitCode
from c3_station.program import PROGRAM

_DEFAULT_SCENARIO = 'ecc2009'
_DEFAULT_RATE = 30.0
"""Times real time: the reference mission in about 18 seconds, so that a person can watch."""


@dataclass(frozen=True, slots=True)
class _Command:
    """A sub-command: how it is described, its options, and what it does."""

    summary: str
    example: str
    add_options: Callable[[argparse.ArgumentParser], None]
    execute: Callable[[argparse.Namespace, Console], ExitCode]


def main(arguments: Sequence[str]) -> int:
    """Run a sub-command (``run`` if none is named) and return the exit code."""
    console = Console(stderr=False)
    parser = _parser()
    words = list(arguments)
    if not words or (words[0].startswith('-') and words[0] not in ('-h', '--help')):
        words.insert(0, 'run')
    options = parser.parse_args(words)
    try:
        return _COMMANDS[options.command].execute(options, console)
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED
    except ValueError as error:
        # Errors of input are ValueErrors that say what is wrong, where, and what is allowed.
        Console(stderr=True).print(str(error), style='bold red', markup=False, highlight=False)
        return ExitCode.BAD_INPUT


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog=PROGRAM,
        description='Shearwater: explore the sea with AUVs and the UAV that relays for them. '
        f'Without a command it flies the mission {_DEFAULT_SCENARIO}.',
    )
    commands = parser.add_subparsers(dest='command', required=True, metavar='command')
    for name, command in _COMMANDS.items():
        sub = commands.add_parser(
            name,
            help=command.summary,
            description=command.summary[0].upper() + command.summary[1:] + '.',
            epilog=f'example: {PROGRAM} {command.example}',
        )
        command.add_options(sub)
    return parser


def _rate(text: str) -> float:
    """Return a pace; 0 stands for as fast as possible, as in the world's parameter."""
    if text == 'max':
        return 0.0
    try:
        rate = float(text)
    except ValueError:
        rate = math.nan
    if not 0.001 <= rate <= 1e6:
        raise argparse.ArgumentTypeError(f"must be 'max' or a number 0.001 ... 1e6, is {text!r}")
    return rate


# --- run -----------------------------------------------------------------------------------------


def _run_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        'scenario', nargs='?', default=_DEFAULT_SCENARIO, help='shipped scenario or a file'
    )
    parser.add_argument('--planner', help="instead of the scenario's planner")
    parser.add_argument('--seed', type=int, help="instead of the scenario's seed")
    parser.add_argument(
        '--set',
        action='extend',
        nargs='+',
        default=[],
        metavar='KEY=VALUE',
        help='change the scenario, such as sortie.limit_s=50 or surfacing=mixed',
    )
    parser.add_argument('--out', type=Path, help='folder to make (default: a new one in runs/)')
    parser.add_argument('--force', action='store_true', help='replace the folder if it exists')
    parser.add_argument(
        '--rate',
        type=_rate,
        help=f'pace: times real time, or max (default {_DEFAULT_RATE:g}; with --no-ros max)',
    )
    parser.add_argument('--no-ros', action='store_true', help='in one process, without ROS')
    parser.add_argument('--no-bag', action='store_true', help='record nothing')


def _run(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.mission_run import RunOptions, run_mission
    from c3_station.scenario_changes import read_change
    from c3_station.scenario_files import load_scenario, with_choices

    scenario = with_choices(
        load_scenario(options.scenario),
        planner=options.planner,
        seed=options.seed,
        changes=[read_change(text) for text in options.set],
    )
    rate = options.rate
    if rate is None:
        rate = 0.0 if options.no_ros else _DEFAULT_RATE
    return run_mission(
        scenario,
        RunOptions(
            out=options.out,
            force=options.force,
            rate=rate,
            ros=not options.no_ros,
            bag=not options.no_bag,
        ),
        console,
    )


# --- bags ----------------------------------------------------------------------------------------


def _report_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('bag', type=Path, help='bag folder of a mission')
    parser.add_argument(
        '--out', type=Path, help='where to write (default: the folder that holds the bag)'
    )


def _report(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.mission_run import report_bag

    return report_bag(options.bag, options.out or options.bag.resolve().parent, console)


def _recover_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('bag', type=Path, help='bag folder, or its .mcap file')
    parser.add_argument('--out', type=Path, help='new bag (default: <bag>_recovered)')


def _recover(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.bag import recover_bag

    out = options.out or options.bag.with_name(f'{options.bag.stem}_recovered')
    messages = recover_bag(options.bag, out)
    console.print(f'{messages} messages recovered into {out}', highlight=False)
    return ExitCode.OK


# --- scenarios -----------------------------------------------------------------------------------


def _check_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('scenario', help='shipped scenario or a file')
    parser.add_argument(
        '--params',
        type=Path,
        metavar='FILE',
        help='also write the parameters of all nodes, to start them by hand',
    )


def _check(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.graph import write_params
    from c3_station.scenario_files import load_scenario

    scenario = load_scenario(options.scenario)
    region = scenario.region
    console.print(
        f'{scenario.name} is in order: {region.cols} x {region.rows} cells of {region.cell_m:g} m,'
        f' {len(scenario.auvs)} AUVs, planner {scenario.planner.name}',
        highlight=False,
    )
    if options.params is not None:
        write_params(scenario, options.params, rate=_DEFAULT_RATE, bag=Path('bag'))
        console.print(f'parameters of all nodes written to {options.params}', highlight=False)
    return ExitCode.OK


def _list_options(parser: argparse.ArgumentParser) -> None:
    del parser  # no options


def _list(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.listing import print_listing

    print_listing(console)
    return ExitCode.OK


# --- bench ---------------------------------------------------------------------------------------


def _bench_options(parser: argparse.ArgumentParser) -> None:
    from c3_station.bench import BENCHMARKS

    parser.add_argument(
        'benchmark',
        nargs='*',
        metavar='BENCHMARK',
        help=f'any of {", ".join(BENCHMARKS)} (default: all but ties)',
    )


def _bench(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.bench import run_benchmarks

    return run_benchmarks(options.benchmark, console)


_COMMANDS = {
    'run': _Command('fly a mission', 'run ecc2009 --rate max', _run_options, _run),
    'report': _Command(
        "rebuild a mission's summary, figures and report from its bag",
        'report runs/ecc2009/bag',
        _report_options,
        _report,
    ),
    'recover': _Command(
        'mend a bag whose recorder was killed',
        'recover runs/ecc2009/bag',
        _recover_options,
        _recover,
    ),
    'bench': _Command('measure this machine, as ratios', 'bench', _bench_options, _bench),
    'check': _Command('check a scenario file', 'check my_bay.yaml', _check_options, _check),
    'list': _Command('list scenarios, planners and drivers', 'list', _list_options, _list),
}
