# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The section on the run itself: game, scenario, participants and settings."""

from collections.abc import Iterator
from datetime import datetime, UTC

from crgame_ros.analysis.report.section import (
    colours_of,
    filled_table,
    free,
    note,
    NOTHING,
    number,
    plain,
    Section,
    table,
)
from crgame_ros.analysis.runs.run import Run
from crgame_ros.game.documents import GameDocument
from crgame_ros.game.objects import Role

# Greatest length of a game file's text that is shown.
_LONGEST_FILE = 20_000


def run_section(run: Run) -> Section:
    """Return the section on the run itself."""
    game = run.log.game
    html = table('The run', (), _facts(run), 'facts')
    html += table('Who was driven', ('vehicle', 'driven by', 'type', 'length × width [m]',
                                     'planning problem', 'sees'), _vehicles(run), 'vehicles')
    html += filled_table('Drivers', (
        'vehicle', 'driver', 'took part as', 'device', 'browser', 'steps', 'input delay [ms]'),
        _people(run), 'people')
    if notices := dict.fromkeys((*run.missing, *run.notices)):
        items = ''.join(f'<li>{free(text)}</li>' for text in notices)
        html += f'<div class="notices"><p>Of the recording:</p><ul>{items}</ul></div>'
    if game.file:
        text = game.file if len(game.file) <= _LONGEST_FILE else game.file[:_LONGEST_FILE] + ' …'
        # Line by line: invisible characters are named, line ends stay.
        lines = '\n'.join(map(plain, text.splitlines()))
        html += f'<details class="file"><summary>Game file</summary><pre>{lines}</pre></details>'
    return Section('run', 'What was run', html)


def title_of(run: Run) -> str:
    """Return a run's title, unescaped."""
    return run.log.game.title or run.log.game.benchmark_id or run.name


def began(run: Run) -> str:
    """Return when a run was recorded."""
    if run.began_ns is None:
        return NOTHING
    when = datetime.fromtimestamp(run.began_ns // 1_000_000_000, UTC)
    return when.strftime('%Y-%m-%d %H:%M:%S UTC')


def _facts(run: Run) -> Iterator[tuple[str, str]]:
    game = run.log.game
    scheduler = game.scheduler
    yield 'game', free(game.title or NOTHING)
    yield 'scenario', free(game.benchmark_id or NOTHING)
    yield 'scenario file', f'<code>SHA-256 {plain(game.scenario_sha256[:16])}…</code>'
    yield 'folder', free(run.name)
    yield 'recorded', began(run)
    yield 'length', (f'{number(float(run.times_s[-1]), 1)} s, scenario steps {run.log.ks[0]} to '
                     f'{run.log.ks[-1]} of {scheduler.time_step_s:g} s')
    yield 'simulation', (f'{1.0 / scheduler.dt_s:g} Hz, real-time factor '
                         f'{game.real_time_factor:g}')
    yield 'seed', str(game.seed)
    yield 'traffic', _traffic(game)
    yield 'others', _others(run)
    yield 'run', f'{game.epoch + 1} of its session'
    for name, parts in (('sound', _sound(run)), ('view', _view(run))):
        if told := '; '.join(parts):
            yield name, told


def _sound(run: Run) -> Iterator[str]:
    """Yield the sound settings in the cockpit's seats; nothing if they were not recorded."""
    for seat, told in ((run.timing or {}).get('sound') or {}).items():
        words = 'off' if told['volume'] is None else \
            f'on for {_percent(told["on_share"])} of the time, volume {_percent(told["volume"])}'
        yield f'{free(seat)} {words}, rumble {_percent(told["rumble"])}'


def _view(run: Run) -> Iterator[str]:
    """Yield the views in the cockpit's seats, with their intervals."""
    for seat, periods in ((run.timing or {}).get('view') or {}).items():
        for period in periods:
            words = [f'{plain(period["shown"])} from {number(period["from_s"], 1)} to '
                     f'{number(period["to_s"], 1)} s']
            if period['across_deg'] is not None:
                words.append(f'{number(period["across_deg"], 0)}° across')
            if period['screen_width_m'] is not None and period['eye_distance_m'] is not None:
                words.append(f'true to scale on a screen of {number(period["screen_width_m"], 2)}'
                             f' m, {number(period["eye_distance_m"], 2)} m from the eyes')
            words += [text for key, text in (('inset', 'with the small map'),
                                             ('plans', 'with the plans of AVs')) if period[key]]
            if period['rate_hz'] is not None:
                words.append(f'{number(period["rate_hz"], 0)} pictures/s')
            if period['renderer']:
                words.append(f'drawn by {"the processor" if period["software"] else "a card"} '
                             f'({free(period["renderer"])})')
            yield f'{free(seat)} {", ".join(words)}'


def _percent(share: float) -> str:
    return f'{100.0 * share:.0f} %'


def _traffic(game: GameDocument) -> str:
    spec = game.traffic
    if spec is None or not (spec.agents or spec.flow or spec.recorded == 'reactive'):
        return 'none that reacts'
    seed = game.seed if spec.seed is None else spec.seed
    return (f'{spec.agents} agents at the start, {spec.flow:g} vehicles/h, recorded vehicles '
            f'{plain(spec.recorded)}, car following {plain(spec.model)}, seed {seed}')


def _others(run: Run) -> str:
    words = {Role.RECORDED: 'recorded', Role.STATIC: 'static', Role.TRAFFIC: 'of traffic',
             Role.SCRIPTED: 'scripted'}
    counts = {word: sum(item.role is role for item in run.log.objects)
              for role, word in words.items()}
    return ', '.join(f'{count} {word}' for word, count in counts.items() if count) or 'nobody'


def _vehicles(run: Run) -> Iterator[tuple[str, ...]]:
    game = run.log.game
    for item in run.log.vehicles:
        size = f'{item.shape.length:.2f} × {item.shape.width:.2f}'
        human, av = game.human(item.id), game.av(item.id)
        if human is not None:
            yield (named(run, item.id), f'driver {free(human.driver)}', free(item.type), size,
                   NOTHING, 'everything')
        elif av is not None:
            options = f' {free(dict(av.options))}' if av.options else ''
            yield (named(run, item.id), f'planner {free(av.planner)}{options}', free(item.type),
                   size, str(av.planning_problem),
                   'everything' if av.perception is None else 'what its sensors do')


def _people(run: Run) -> Iterator[tuple[str, ...]]:
    """Yield the people in cockpit seats, and the local devices that drove."""
    scheduler = run.log.game.scheduler
    last_n = int(run.log.ks[-1] - scheduler.k0) * scheduler.steps_per_tick
    for spell, delay_ms, _ in run.record.drivers:
        person = spell.person
        if person is not None:
            who = tuple(free(text or NOTHING) for text in (
                person.name, person.role, person.device, person.browser))
        elif delay_ms is not None:
            who = NOTHING, 'driver', free(spell.driver), 'at the machine'
        else:
            continue
        until_n = last_n if spell.until_n is None else spell.until_n
        yield (named(run, spell.seat), *who, f'{spell.from_n} to {until_n}', number(delay_ms, 0))


def named(run: Run, vehicle: str) -> str:
    """Return an id as HTML, with the colour of its lines if it is driven."""
    colour = colours_of(run).get(vehicle)
    mark = '' if colour is None else f'<span class="mark {colour}" aria-hidden="true"></span>'
    return mark + free(vehicle)


def software_note(lines: tuple[tuple[str, str], ...], here: bool) -> str:
    """
    Return HTML on the software and the machine that wrote the report.

    :param lines: what, and which.
    :param here: whether the run was driven on that machine just before.
    """
    of = 'Run and report are of' if here else 'The report is of'
    return note(f'{of} ' + ', '.join(f'{plain(what)} {plain(which)}' for what, which in lines)
                + '.' + ('' if here else ' The recording does not say what drove the run.'))
