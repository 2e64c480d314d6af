"""The command line: one sub-command, one function."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console

from c3_station.exit_codes import ExitCode
from c3_station.program import PROGRAM

if TYPE_CHECKING:
    from c3_station.scenario_generator import Span

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
    words = list(arguments)
    if not words or (words[0].startswith('-') and words[0] not in ('-h', '--help')):
        words.insert(0, 'run')
    options = _parser(words[0]).parse_args(words)
    try:
        return _COMMANDS[options.command].execute(options, console)
    except KeyboardInterrupt:
        return ExitCode.INTERRUPTED
    except ValueError as error:
        # Errors of input are ValueErrors that say what is wrong, where, and what is allowed.
        Console(stderr=True).print(
            str(error), style='bold red', markup=False, highlight=False, soft_wrap=True
        )
        return ExitCode.BAD_INPUT


def _parser(chosen: str) -> argparse.ArgumentParser:
    """Return the parser, with the options of one command: for some of them much is imported."""
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
        if name == chosen:
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
    parser.add_argument(
        '--key-file',
        type=Path,
        help='key that signs what goes by radio, mode 0600 (default: a new one)',
    )


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
            key_file=options.key_file,
        ),
        console,
    )


def _resume_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('out', type=Path, help='folder of the run')


def _resume(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.mission_run import resume_mission

    return resume_mission(options.out, console)


# --- campaign ------------------------------------------------------------------------------------

_DEFAULT_MISSIONS = 100


def _count(text: str) -> int:
    try:
        count = int(text)
    except ValueError:
        count = 0
    if not 1 <= count <= 1_000_000:
        raise argparse.ArgumentTypeError(f'must be a whole number 1 ... 1,000,000, is {text!r}')
    return count


def _campaign_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('scenarios', nargs='*', metavar='SCENARIO', help='shipped or a file')
    parser.add_argument(
        '--missions',
        type=_count,
        help=f'missions for each scenario, variation and planner (default {_DEFAULT_MISSIONS})',
    )
    parser.add_argument('--planner', metavar='A,B', help="default: the scenario's planner")
    parser.add_argument(
        '--vary',
        action='extend',
        nargs='+',
        metavar='KEY=V1,V2',
        help='change the scenario, once for each value; all keys with all others,'
        ' such as surfacing=early_10,slow,mixed sortie.limit_s=50,60',
    )
    parser.add_argument(
        '--seed', type=int, metavar='FIRST', help='seed of the first mission (default 0)'
    )
    parser.add_argument('--jobs', type=_count, help='processes that fly (default: one per core)')
    parser.add_argument(
        '--dask', metavar='ADDRESS', help='fly on a Dask cluster instead, such as tcp://host:8786'
    )
    parser.add_argument(
        '--out', type=Path, metavar='DIR', help='folder, new or of the same campaign broken off'
    )
    parser.add_argument(
        '--fail-on-violation',
        action='store_true',
        help='exit with 1 if a sortie was over its limit, an AUV missed or a sample lost, too',
    )
    known = parser.add_mutually_exclusive_group()
    known.add_argument('--resume', type=Path, metavar='DIR', help='fly what is left of a campaign')
    known.add_argument(
        '--report', type=Path, metavar='DIR', help='tell and report what is flown so far'
    )
    known.add_argument(
        '--mission',
        nargs=2,
        metavar=('DIR', 'NUMBER'),
        help='print how one of its missions is flown again',
    )


def _campaign(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station import campaign_command
    from c3_station.campaign_plan import plan_campaign
    from c3_station.scenario_changes import read_variants

    asked = {
        name: getattr(options, name)
        for name in ('scenarios', 'missions', 'planner', 'vary', 'seed', 'out')
    }
    given = [name for name, value in asked.items() if value not in (None, [])]
    if given and (options.resume or options.report or options.mission):
        raise ValueError(
            f'campaign: {", ".join(given)} cannot be chosen for a campaign that there is already'
        )
    if options.jobs and options.dask:
        raise ValueError('campaign: --jobs and --dask exclude each other')
    flying = campaign_command.FlyingOptions(
        jobs=options.jobs, dask=options.dask, fail_on_violation=options.fail_on_violation
    )
    if options.mission:
        folder, number = options.mission
        return campaign_command.show_mission(Path(folder), number, console)
    if options.report:
        return campaign_command.report_campaign(options.report, flying, console)
    if options.resume:
        return campaign_command.resume_campaign(options.resume, flying, console)
    campaign = plan_campaign(
        scenarios=options.scenarios,
        planners=options.planner.split(',') if options.planner else (),
        variations=[read_variants(text) for text in options.vary or ()],
        first_seed=options.seed or 0,
        seeds=options.missions or _DEFAULT_MISSIONS,
    )
    return campaign_command.new_campaign(campaign, options.out, flying, console)


# --- faults --------------------------------------------------------------------------------------

_FAULT_MISSIONS = 20


def _faults_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        'scenario', nargs='?', default=_DEFAULT_SCENARIO, help='shipped scenario or a file'
    )
    parser.add_argument(
        '--planner', default='robust', help='must keep the sortie limit (default robust)'
    )
    parser.add_argument(
        '--missions',
        type=_count,
        default=_FAULT_MISSIONS,
        help=f'missions for each row of the table (default {_FAULT_MISSIONS})',
    )
    parser.add_argument(
        '--ros',
        type=_count,
        default=0,
        metavar='N',
        help='fly so many more of each row that strikes processes, by ROS 2 nodes',
    )
    parser.add_argument('--jobs', type=_count, help='processes that fly (default: one per core)')
    parser.add_argument(
        '--out', type=Path, metavar='DIR', help='folder, new or of the same table broken off'
    )


def _faults(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.faults_command import FaultsOptions, fly_faults

    return fly_faults(
        FaultsOptions(
            scenario=options.scenario,
            planner=options.planner,
            missions=options.missions,
            by_nodes=options.ros,
            jobs=options.jobs,
            out=options.out,
        ),
        console,
    )


# --- bags ----------------------------------------------------------------------------------------


def _report_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument('bag', type=Path, help='bag of a mission, or the folder it is in')
    parser.add_argument(
        '--out', type=Path, help='where to write (default: the folder that holds the bag)'
    )


def _report(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.mission_run import report_bag

    return report_bag(options.bag, options.out, console)


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
    from c3_station.radio_checks import copies_said
    from c3_station.scenario_files import load_scenario

    scenario = load_scenario(options.scenario)
    console.print(
        f'{scenario.name} is in order: {scenario.region}, {len(scenario.auvs)} AUVs,'
        f' planner {scenario.planner.name}',
        highlight=False,
    )
    repeats = copies_said(scenario)
    if repeats:
        console.print(repeats, highlight=False, soft_wrap=True)
    if options.params is not None:
        write_params(scenario, options.params, rate=_DEFAULT_RATE, bag=Path('bag'))
        console.print(f'parameters of all nodes written to {options.params}', highlight=False)
    return ExitCode.OK


def _generate_options(parser: argparse.ArgumentParser) -> None:
    from c3_station.scenario_generator import MODELS, QUANTITIES, USUAL_MODELS

    parser.add_argument('--seed', type=int, required=True, help='of the first scenario')
    parser.add_argument(
        '--count', type=_count, default=1, help='how many scenarios, with seeds that follow'
    )
    parser.add_argument(
        '--out',
        type=Path,
        default=Path(),
        help='a file to write, or a folder for generated_SEED.yaml (default: this one)',
    )
    parser.add_argument('--force', action='store_true', help='replace files')
    for name, quantity in QUANTITIES.items():
        usual = f' (default {quantity.usual})' if quantity.usual else ''
        parser.add_argument(
            f'--{name}', type=_span, metavar='A-B', help=f'{quantity.meaning}{usual}'
        )
    parser.add_argument(
        '--models',
        metavar='A,B',
        default=','.join(USUAL_MODELS),
        help=f'surfacing models, any of {", ".join(MODELS)} (default %(default)s)',
    )


def _span(text: str) -> Span:
    from c3_station.scenario_generator import read_span

    try:
        return read_span(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _generate(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.generate_command import GenerateOptions, generate
    from c3_station.scenario_generator import QUANTITIES

    asked = {name: getattr(options, name.replace('-', '_')) for name in QUANTITIES}
    return generate(
        GenerateOptions(
            seed=options.seed,
            count=options.count,
            asked={name: span for name, span in asked.items() if span is not None},
            models=options.models.split(','),
            out=options.out,
            force=options.force,
        ),
        console,
    )


def _list_options(parser: argparse.ArgumentParser) -> None:
    del parser  # no options


def _list(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.listing import print_listing

    print_listing(console)
    return ExitCode.OK


# --- bench ---------------------------------------------------------------------------------------


def _bench_options(parser: argparse.ArgumentParser) -> None:
    from c3_station.bench import BENCHMARKS, ON_REQUEST

    parser.add_argument(
        'benchmark',
        nargs='*',
        metavar='BENCHMARK',
        help=f'any of {", ".join(BENCHMARKS)} (default: all but {", ".join(ON_REQUEST)})',
    )
    planners = parser.add_argument_group('of the benchmark planners')
    planners.add_argument('--families', metavar='A,B', help='families of scenarios (default: all)')
    planners.add_argument('--planners', metavar='A,B', help='planners (default: all)')
    planners.add_argument(
        '--seeds', type=_count, help='missions of each family with each planner (default 3)'
    )
    planners.add_argument('--out', type=Path, metavar='DIR', help='folder (default: new in runs/)')
    planners.add_argument('--processes', type=_count, help='default: one per core')


def _bench(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.bench import run_benchmarks
    from c3_station.bench_planners import PlannersOptions

    planners = PlannersOptions(
        families=options.families and tuple(options.families.split(',')),
        planners=options.planners and tuple(options.planners.split(',')),
        seeds=options.seeds,
        out=options.out,
        processes=options.processes,
    )
    is_asked = planners != PlannersOptions()
    return run_benchmarks(options.benchmark, console, planners if is_asked else None)


def _command_options(parser: argparse.ArgumentParser) -> None:
    from c3_station.operator_words import USAGE

    parser.add_argument('run', type=Path, help='folder of a mission that is being flown')
    parser.add_argument('words', nargs='+', metavar='COMMAND', help=USAGE)


def _command(options: argparse.Namespace, console: Console) -> ExitCode:
    from c3_station.command_command import command

    return command(options.run, options.words, console)


_COMMANDS = {
    'run': _Command('fly a mission', 'run ecc2009 --rate max', _run_options, _run),
    'resume': _Command(
        'go on with a mission whose machine went down',
        'resume runs/ecc2009',
        _resume_options,
        _resume,
    ),
    'campaign': _Command(
        'fly many missions, over seeds and variations of scenarios, and compare planners',
        'campaign ecc2009 --missions 200 --vary surfacing=early_10,slow,mixed',
        _campaign_options,
        _campaign,
    ),
    'faults': _Command(
        'fly missions in which much goes wrong, and check that nothing is lost',
        'faults --missions 5',
        _faults_options,
        _faults,
    ),
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
    'command': _Command(
        'tell the C3 of a running mission what the operator wants',
        'command runs/ecc2009 recall auv_2',
        _command_options,
        _command,
    ),
    'bench': _Command('measure this machine, as ratios', 'bench', _bench_options, _bench),
    'check': _Command('check a scenario file', 'check my_bay.yaml', _check_options, _check),
    'generate': _Command(
        'draw random scenarios that can be flown',
        'generate --seed 7 --cols 5-12 --rows 5-12 --auvs 2-4 --out drawn.yaml',
        _generate_options,
        _generate,
    ),
    'list': _Command('list scenarios, planners and drivers', 'list', _list_options, _list),
}
