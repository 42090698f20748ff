# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""`crgame new`: games with several seats, for any scenario."""

from pathlib import Path

from crgame_ros.cli import main
from crgame_ros.game.game import load_game
from crgame_ros.paths import scenarios_directory
from crgame_ros.simulation.setup import build_setup
import pytest

TWO_AVS = scenarios_directory() / 'C-ZAM_TwoAvs-1_1_T-1.xml'


def test_each_seat_has_a_place_of_its_own(tmp_path: Path) -> None:
    """On free lanes, all problems driven by AVs; the file can be run as it is."""
    out = tmp_path / 'game.yaml'
    assert main(['new', str(TWO_AVS), '--humans', '3', '--planner', 'constant-velocity',
                 '--out', str(out)]) == 0
    setup = build_setup(load_game(out))
    assert [human.driver for human in setup.humans] == ['cockpit'] * 3
    assert [av.spec.planner for av in setup.avs] == ['constant-velocity'] * 2
    states = [item.state for item in (*setup.humans, *setup.avs)]
    # No two cars of 4.5 m x 1.6 m touch, nor do their margins of 0.5 m.
    for index, one in enumerate(states):
        for other in states[index + 1:]:
            assert (one.x - other.x) ** 2 + (one.y - other.y) ** 2 > 2.6 ** 2


def test_people_start_where_problems_begin(tmp_path: Path) -> None:
    """One takes the first problem's place, and an AV has the other."""
    out = tmp_path / 'game.yaml'
    assert main(['new', str(TWO_AVS), '--at', 'problems', '--driver', 'idle', '--out',
                 str(out)]) == 0
    setup = build_setup(load_game(out))
    first = build_setup(load_game(scenarios_directory() / 'two_avs.yaml')).avs[0].state
    human = setup.humans[0].state
    assert (human.x, human.y) == pytest.approx((first.x, first.y), abs=0.01)
    assert human.speed == pytest.approx(first.speed, abs=0.01)
    assert [av.planning_problem.planning_problem_id for av in setup.avs] == [101]


@pytest.mark.parametrize(('words', 'said'), [
    (['--humans', '0'], '--humans: is 0; give 1 to 16'),
    (['--driver', 'telepathy'], 'no driver source'),
    (['--planner', 'telepathy'], 'no planner "telepathy"'),
    (['--out', 'new.yaml', '--duration', '-5'], 'new.yaml: "duration" is -5'),
    (['--out', 'new.yaml', '--duration', 'nan'], 'new.yaml: "duration" is nan'),
    (['--out', str(TWO_AVS)], 'is there already')])
def test_what_cannot_be_written_is_said_in_one_line(
        words: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    """The exit code is 2, and no file is written."""
    monkeypatch.chdir(tmp_path)
    before = TWO_AVS.read_bytes()
    assert main(['new', str(TWO_AVS), *words]) == 2
    error = capsys.readouterr().err
    assert said in error and error.count('\n') == 1
    assert TWO_AVS.read_bytes() == before and not list(tmp_path.iterdir())


def test_the_example_for_two_is_a_game() -> None:
    """Two seats for pages, one AV."""
    example = Path(__file__).resolve().parents[1] / 'examples' / 'two_humans.yaml'
    setup = build_setup(load_game(example))
    assert [human.driver for human in setup.humans] == ['cockpit', 'cockpit']
    assert len(setup.avs) == 1
