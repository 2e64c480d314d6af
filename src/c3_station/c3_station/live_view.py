"""The terminal view of a running mission (rich)."""

from __future__ import annotations

from rich.align import Align
from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.panel import Panel
from rich.progress_bar import ProgressBar
from rich.table import Table
from rich.text import Text

from c3_station.mission_monitor import AuvView, MissionMonitor, SortieView
from msgs_json.messages import AuvStatus, ContactState

# Okabe-Ito: told apart with any colour vision. The last one is the UAV's.
_AUV_COLOURS = ('#56B4E9', '#E69F00', '#009E73', '#CC79A7', '#F0E442', '#D55E00')
_UAV_COLOUR = 'bold #FFFFFF'
_C3_COLOUR = '#E69F00'
_LAND_COLOUR = '#8C8070'
_LOG_LINES = 8
_MAP_COLS_MAX = 40
_STATE_WIDTH = 80
"""Columns that the state of the mission needs, beside the map or alone."""
_COLUMNS = ('AUV', 'state', 'contact', 'next', 'neglect', 'last met', 'leg')
_COLUMNS_THAT_MATTER = 5
_TIMES = ('next', 'neglect', 'last met')


class LiveView:
    """Renders a `MissionMonitor`; give it to `rich.live.Live` and refresh."""

    def __init__(self, mission: MissionMonitor, title: str) -> None:
        self._mission = mission
        self._title = title
        self.real_time_factor = 0.0

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        """Lay out map and state side by side, the log below."""
        mission = self._mission
        auvs = self._auvs(everything=options.max_width >= _STATE_WIDTH)
        state = Group(self._clock(), self._uav(), self._operator(), self._coverage(), Text(), auvs)
        show_map = (
            mission.scenario.region.cols <= _MAP_COLS_MAX
            and options.max_width >= 2 * mission.scenario.region.cols + _STATE_WIDTH
        )
        body = Table.grid(padding=(0, 2), expand=True)
        if show_map:
            body.add_column(width=2 * mission.scenario.region.cols + 4)
            body.add_column(ratio=1)
            body.add_row(self._map(), state)
        else:
            body.add_row(state)
        yield Panel(
            Group(body, Text(), self._log()),
            title=f'[bold]Shearwater[/]  {self._title}',
            title_align='left',
            border_style='dim',
        )

    def _clock(self) -> Text:
        mission = self._mission
        text = Text.assemble(
            ('t = ', 'dim'),
            (f'{mission.now_s:7.1f} s', 'bold'),
            ('    real time ', 'dim'),
            f'x {self.real_time_factor:,.1f}',
        )
        if mission.domain_id is not None:
            text.append(f'    ROS_DOMAIN_ID={mission.domain_id}', style='dim')
        if mission.refused:
            text.append(f'    refused messages {mission.refused}', style='bold #D55E00')
        return text

    def _uav(self) -> Text:
        mission = self._mission
        text = Text.assemble(('UAV   ', _UAV_COLOUR))
        sortie = mission.sortie
        if sortie is None:
            doing = 'waiting for the next departure'
            if mission.directive is not None and mission.directive.aborted:
                doing = 'aborted until a reset'
            elif mission.directive is not None and mission.directive.paused:
                doing = 'paused'
            if mission.planned_share is not None:
                doing = f'planning ahead {mission.planned_share:.0%}'
            text.append(mission.ended or f'at C3, {doing}')
            return text
        flown_s = mission.now_s - sortie.departed_s
        late = sortie.worst_case_s > sortie.limit_s
        text.append(f'sortie {sortie.number}, {self._doing(sortie)}   ')
        text.append(f'{flown_s:3.0f}', style='bold')
        text.append(f' of {sortie.limit_s:.0f} s  ')
        text.append(
            f'worst case {sortie.worst_case_s:.0f} s', style='bold #D55E00' if late else 'dim'
        )
        return text

    def _operator(self) -> Text:
        """Return what the operator wants beside the order, or an empty line."""
        wanted = self._mission.operator
        directive = self._mission.directive
        if wanted is None or directive is None:
            return Text()
        style = 'bold #D55E00' if directive.aborted else '#E69F00'
        return Text.assemble(('operator   ', 'dim'), (wanted, style), ('\n', ''))

    @staticmethod
    def _doing(sortie: SortieView) -> str:
        target = sortie.target()
        return f'looking for {target}' if target else 'flying home'

    def _coverage(self) -> Table:
        mission = self._mission
        total = len(mission.cells)
        table = Table.grid(padding=(0, 1))
        for label, cells, colour in (
            ('entered', len(mission.cells & mission.entered), '#56B4E9'),
            ('delivered', mission.cells_delivered, '#009E73'),
        ):
            bar = ProgressBar(
                total=total,
                completed=cells,
                width=24,
                complete_style=colour,
                finished_style=colour,
            )
            table.add_row(Text(label, 'dim'), bar, f'{cells} of {total} cells')
        neglect_s = mission.neglect_s()
        share = neglect_s / (mission.explored_s or mission.now_s or 1.0)
        table.add_row(
            Text('neglect', 'dim'), f'{neglect_s:.0f} s', f'{share:.1%} of the time, all AUVs'
        )
        table.add_row(
            Text('sorties', 'dim'),
            f'{mission.sorties_flown} flown',
            f'longest {mission.longest_sortie_s:.0f} of {mission.limit_s:.0f} s',
        )
        return table

    def _auvs(self, *, everything: bool) -> Table:
        """Return a row for each AUV; in a narrow terminal what matters least is left out."""
        mission = self._mission
        table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0), header_style='dim')
        columns = _COLUMNS if everything else _COLUMNS[:_COLUMNS_THAT_MATTER]
        for column in columns:
            table.add_column(column, justify='right' if column in _TIMES else 'left')
        for number, (name, auv) in enumerate(mission.auvs.items()):
            cells: tuple[Text | str, ...] = (
                Text(f'{number + 1} {name}', _colour(number)),
                _state(auv, mission.now_s, is_recalled=name in mission.recalled),
                _contact(auv.status),
                _time(auv.status.next_contact_s if auv.status else None),
                _time(mission.auv_neglect_s(auv)),
                _time(auv.last_met_s),
                f'{auv.cells_entered}/{max(0, len(auv.path) - 1)} cells',
            )
            table.add_row(*cells[: len(columns)])
        return table

    def _map(self) -> Align:
        mission = self._mission
        region = mission.scenario.region
        occupied = {
            region.cell_at(auv.position): (str((number + 1) % 10), _colour(number), auv)
            for number, auv in enumerate(mission.auvs.values())
        }
        uav_cell = region.cell_at(mission.uav_position)
        c3 = mission.scenario.c3
        c3_cell = region.cell_at(c3)
        c3_is_inside = (
            0 < c3.east_m < region.cols * region.cell_m
            and 0 < c3.north_m < region.rows * region.cell_m
        )
        rows = Text()
        for row in reversed(range(region.rows)):
            for col in range(region.cols):
                cell = (col, row)
                is_land = cell not in mission.cells
                if cell in occupied:
                    mark, colour, auv = occupied[cell]
                    style = f'{colour} dim' if auv.submerged else f'bold black on {colour}'
                    rows.append(mark, style)
                elif is_land:
                    rows.append('▒', _LAND_COLOUR)
                else:
                    rows.append('·' if cell not in mission.entered else '█', '#3B6E8F')
                if cell == uav_cell:
                    rows.append('✈', _UAV_COLOUR)
                elif c3_is_inside and cell == c3_cell:
                    rows.append('⌂', _C3_COLOUR)
                else:
                    rows.append('▒' if is_land else ' ', _LAND_COLOUR)
            rows.append('\n')
        caption = '⌂ C3' if c3_is_inside else ' ' * (2 * c3_cell[0]) + '⌂ C3'
        rows.append(caption, _C3_COLOUR)
        if len(mission.cells) < region.cols * region.rows:
            rows.append('\n▒ land, no-go', _LAND_COLOUR)
        return Align(Panel(rows, border_style='dim', padding=(0, 1), width=2 * region.cols + 4))

    def _log(self) -> Table:
        table = Table.grid(padding=(0, 2))
        lines = list(self._mission.log)[-_LOG_LINES:]
        for time_s, source, text in lines:
            table.add_row(Text(f'{time_s:8.1f} s', 'dim'), Text(source, 'dim'), text)
        for _ in range(_LOG_LINES - len(lines)):
            table.add_row('', '', '')
        return table


def _colour(number: int) -> str:
    return _AUV_COLOURS[number % len(_AUV_COLOURS)]


def _state(auv: AuvView, now_s: float, *, is_recalled: bool) -> Text:
    if auv.surfaced_s is not None:
        doing = 'asks for help' if auv.asked_for_help else 'waiting'
        return Text(f'{doing} {auv.waiting_s(now_s):.0f} s', 'bold #E69F00')
    if auv.recovered and auv.asked_for_help:
        return Text('up, needs help', '#E69F00')
    if auv.recovered:
        return Text('recovered', '#009E73')
    return Text('recalled' if is_recalled else 'under water', 'dim')


def _contact(status: AuvStatus | None) -> Text:
    """Return what C3 makes of an AUV's silence."""
    if status is None or status.contact is None:
        return Text('-', 'dim')
    match status.contact:
        case ContactState.EXPECTED_SILENT:
            return Text('expected silent', 'dim')
        case ContactState.DUE:
            return Text('due', '#E69F00')
        case ContactState.OVERDUE:
            return Text(f'overdue, {status.searches_in_vain} in vain', 'bold #D55E00')
        case ContactState.LOST:
            return Text('LOST', 'bold white on #D55E00')


def _time(time_s: float | None) -> str:
    return '-' if time_s is None else f'{time_s:.0f} s'
