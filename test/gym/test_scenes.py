# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Options of `reset`, and folders of scenes with their splits."""

from pathlib import Path
import shutil

from crgame_ros.errors import InputError
from crgame_ros.gym.driving_env import DrivingEnv
from crgame_ros.gym.games_together import GamesTogether
from crgame_ros.gym.parallel_env import ParallelDrivingEnv
from crgame_ros.gym.scenes import is_for_test
from crgame_ros.gym.shipped_environments import FOLDER
import gymnasium
from gymnasium.utils.env_checker import check_env
import numpy as np
import pytest

SCENARIOS = Path(__file__).resolve().parents[2] / 'scenarios'
STILL = np.zeros(2, np.float32)


@pytest.fixture(scope='module')
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make a folder of two games, a timeline of one of them, and a CommonRoad file alone."""
    made = tmp_path_factory.mktemp('scenes')
    for name in ('cut_in.yaml', 'cut_in.keys.yaml', 'ZAM_CutIn-1_1_T-1.xml', 'cut_in_family.yaml',
                 'ZAM_Merge-1_1_T-1.xml'):
        shutil.copy(SCENARIOS / name, made)
    return made


@pytest.mark.parametrize(('options', 'said'), [
    ({'seen': 1}, 'known are scene, start, difficulty'), ({'difficulty': 1.5}, 'from 0 to 1'),
    ({'start': {'fast': 1.0}}, 'known are speed, along'), ({'start': {'speed': 99.0}}, '50'),
    ({'scene': 'moon'}, 'there is no scene "moon"; use cut_in.yaml')])
def test_options_that_are_none_are_refused_in_a_line(options: dict[str, object],
                                                     said: str) -> None:
    for env in (DrivingEnv(game='cut_in'), ParallelDrivingEnv(game='cut_in'),
                GamesTogether(1, game='cut_in')):
        with pytest.raises(InputError, match=said):
            env.reset(seed=0, options=options)


def test_a_stated_start_is_the_games_start_shifted_along_the_route() -> None:
    env = DrivingEnv(game='lane_change', vary={'speed': 5.0, 'along': 20.0})
    nominal = DrivingEnv(game='lane_change').reset(seed=0)[0]['state']
    path, before = None, None
    for along in (0.0, 12.0):
        seen = env.reset(seed=3, options={'start': {'speed': -4.0, 'along': along}})[0]['state']
        assert seen[0] == pytest.approx(nominal[0] - 4.0)
        seat = env.agent.seats[0]
        path = seat.guide.driving.path
        s = float(path.project(np.array([seat.state[:2]]))[0][0])
        assert seat.place.d == pytest.approx(0.0, abs=0.01)
        before = s if before is None else before
        assert s - before == pytest.approx(along, abs=0.05)


def test_difficulty_scales_the_start_the_variants_and_the_traffic() -> None:
    env = DrivingEnv(game='cut_in', vary={'speed': 6.0})
    nominal = float(DrivingEnv(game='cut_in').reset(seed=0)[0]['state'][0])
    changes = [float(env.reset(seed=4, options={'difficulty': share})[0]['state'][0]) - nominal
               for share in (0.0, 0.25, 1.0)]
    assert changes[0] == 0.0
    assert abs(changes[2]) > 0.1
    assert changes[1] == pytest.approx(0.25 * changes[2], rel=1e-4)
    assert env.reset(seed=4)[0]['state'][0] == pytest.approx(nominal + changes[2])
    # The family's nominal gap is 30 m, its range 2 to 60 m, uniform. The rear of the 4.508 m long
    # vehicle ahead is its centre less half its length.
    family = DrivingEnv(game='cut_in_family')
    gaps = {share: np.array([
        family.reset(seed=seed, options={'difficulty': share})[0]['objects'][0, 1]
        for seed in range(12)]) for share in (0.0, 0.5, 1.0)}
    assert np.ptp(gaps[0.0]) == 0.0
    at_gap_0 = gaps[0.0][0] - 30.0
    assert (gaps[1.0] - at_gap_0 >= 2.0).all()
    assert (gaps[1.0] - at_gap_0 <= 60.0).all()
    assert gaps[0.5] - gaps[0.0] == pytest.approx(0.5 * (gaps[1.0] - gaps[0.0]), abs=1e-3)
    assert np.ptp(gaps[1.0]) > 20.0


@pytest.mark.slow
def test_difficulty_thins_traffic() -> None:
    env = DrivingEnv(game='dense_merge')
    counts = []
    for share in (0.0, 0.5, 1.0, None):
        env.reset(seed=1, options={} if share is None else {'difficulty': share})
        counts.append(int(np.isfinite(env.agent.game.objects.poses[:, 0]).sum()))
    assert counts[0] == 0
    assert 0 < counts[1] < counts[2] == counts[3]


def test_a_split_depends_on_the_name_alone() -> None:
    names = [f'scene_{number}.xml' for number in range(2000)]
    tested = {name for name in names if is_for_test(name, 0.2)}
    # 2000 draws: four standard deviations are 72.
    assert abs(len(tested) - 400) < 72
    assert tested < {name for name in names if is_for_test(name, 0.3)}
    # The bits of this rule are a promise to those who publish results.
    assert [is_for_test(name, 0.5) for name in ('cut_in.yaml', 'merge.yaml', 'crossing.yaml')] == [
        False, False, True]


def test_a_folder_is_an_environment_of_its_games_and_scenarios(folder: Path) -> None:
    keywords = {'scenes': folder, 'vary': {'speed': 3.0}, 'duration': 1.0}
    env = gymnasium.make(FOLDER, **keywords).unwrapped
    assert isinstance(env, DrivingEnv)
    names = ('ZAM_Merge-1_1_T-1.xml', 'cut_in.yaml', 'cut_in_family.yaml')
    assert env.experiment.setups.scenes.names == names
    drawn = [env.reset(seed=seed)[1]['scene'] for seed in range(20)]
    assert set(drawn) == set(names)
    assert [env.reset(seed=seed)[1]['scene'] for seed in range(20)] == drawn
    # Chosen by name, a scene is what an environment of it alone is.
    alone = DrivingEnv(game=folder / 'cut_in.yaml', vary={'speed': 3.0}, duration=1.0)
    first, other = env.reset(seed=5, options={'scene': 'cut_in.yaml'}), alone.reset(seed=5)
    for _ in range(10):
        for part, values in first[0].items():
            assert (values == other[0][part]).all()
        first, other = env.step(STILL), alone.step(STILL)
        assert first[1:] == other[1:]
    assert first[3]
    check_env(env, skip_render_check=True)


def test_games_of_several_scenes_together_are_those_one_after_the_other(folder: Path) -> None:
    keywords = {'scenes': folder, 'duration': 0.5}
    together = GamesTogether(3, **keywords)
    apart = gymnasium.make_vec(FOLDER, 3, vectorization_mode='sync', **keywords)
    first, second = together.reset(seed=2), apart.reset(seed=2)
    assert len(set(first[1]['scene'])) > 1
    for _ in range(12):
        for part, values in first[0].items():
            assert (values == second[0][part]).all()
        for key, values in second[-1].items():
            if not isinstance(values, dict):
                assert (np.asarray(first[-1][key]) == np.asarray(values)).all(), key
        first, second = together.step(np.zeros((3, 2))), apart.step(np.zeros((3, 2)))


def test_folders_that_are_no_good_are_refused_in_a_line(folder: Path, tmp_path: Path) -> None:
    for keywords, said in (
            ({'scenes': tmp_path}, 'has no scenes'), ({'scenes': tmp_path / 'no'}, 'no such'),
            ({'scenes': folder, 'split': 'trial'}, 'train, test, all'),
            ({'scenes': folder, 'test_share': 2.0}, 'from 0 to 1'),
            ({'scenes': folder, 'split': 'test', 'test_share': 0.0}, 'none of them in the split'),
            ({'scenes': folder, 'game': 'cut_in'}, 'one of them'),
            ({'scenes': folder, 'planners': {'av0': 'idm'}, 'split': 'all'},
             'ZAM_Merge-1_1_T-1.xml: planners: the game does not list')):
        with pytest.raises(InputError, match=said):
            DrivingEnv(**keywords)
    (tmp_path / 'a.xml').write_text('<osm/>')
    with pytest.raises(InputError, match=r'a\.xml: is no CommonRoad scenario'):
        DrivingEnv(scenes=tmp_path)
    (tmp_path / 'a.xml').unlink()
    (tmp_path / 'b.yaml').write_text('scenario: [')
    with pytest.raises(InputError, match=r'b\.yaml'):
        DrivingEnv(scenes=tmp_path)
