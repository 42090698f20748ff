# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Frames show footprints, ways and plans where the log has them, at one scale."""

from dataclasses import replace
from xml.etree import ElementTree

from crgame_ros.analysis.pictures.frame_svg import frame_svg
from crgame_ros.analysis.pictures.frame_window import FrameWindow
from crgame_ros.analysis.pictures.frames_figure import frames_figure, panel_steps
from crgame_ros.analysis.pictures.scene_frame import FollowedPlan, FrameScene
from crgame_ros.errors import InputError
from crgame_ros.game.objects import ObjectDescription
from crgame_ros.geometry.outline import outline, placed
from crgame_ros.geometry.reference_point import shifted
from crgame_ros.recording.run_record import RunRecord
from crgame_ros.recording.run_trajectories import RunTrajectories
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
import numpy as np
from numpy.typing import NDArray
import pytest

FloatArray = NDArray[np.float64]


def _in_map(points: FloatArray, window: FrameWindow) -> FloatArray:
    """Turn a window's coordinates back, as complex numbers: independent of the code's matrix."""
    there = (points[:, 0] + 1j * points[:, 1]) * np.exp(1j * window.yaw)
    return np.column_stack((there.real + window.x, there.imag + window.y))


def _expected(log: RunTrajectories, row: int) -> dict[str, FloatArray]:
    """Return the outlines of all present vehicles and objects, from the log."""
    found = {}
    for i, item in enumerate(log.vehicles):
        pose = shifted(log.vehicle_states[row, i, :3], item.rear_to_center)
        found[item.id] = placed(outline(item.shape), pose)
    for i, item in enumerate(log.objects):
        if np.isfinite(log.object_poses[row, i, 0]):
            found[item.id] = placed(outline(item.shape), log.object_poses[row, i])
    return found


def _drawn(axes: Axes, kind: str) -> dict[str, FloatArray]:
    found = {}
    for patch in axes.patches:
        what, _, name = str(patch.get_gid()).partition(' ')
        if what == kind and isinstance(patch, Polygon):
            found[name] = np.asarray(patch.get_xy())[:-1]
    return found


@pytest.mark.parametrize('name', ['two_avs', 'parked_cars'])
def test_footprints_are_the_placed_outlines(name: str, request: pytest.FixtureRequest) -> None:
    """The window has all its outlines in data coordinates, and every driven vehicle."""
    log: RunTrajectories = request.getfixturevalue(name).log
    scene = FrameScene(log)
    ks = log.ks[[5, 12, 19]].tolist()
    figure = frames_figure(scene, ks)
    windows = scene.windows([5, 12, 19])
    driven = {item.id for item in log.vehicles}
    for axes, window, row in zip(figure.axes, windows, (5, 12, 19), strict=True):
        bodies, expected = _drawn(axes, 'body'), _expected(log, row)
        assert driven <= set(bodies)
        for body, corners in bodies.items():
            assert _in_map(corners, window) == pytest.approx(expected[body], abs=1e-9)
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        for body in driven:
            assert np.all((bodies[body] > (left, bottom)) & (bodies[body] < (right, top)))
        # No footprint that reaches into the window is left out.
        for body, corners in expected.items():
            inside = np.abs(window.to_window(corners)) < (0.5 * window.length, 0.5 * window.height)
            assert not inside.all(axis=1).any() or body in bodies
    assert len({(window.length, window.height) for window in windows}) == 1
    # A metre has the same length in both directions.
    size = figure.get_size_inches()
    for axes in figure.axes:
        box = axes.get_position()
        metre = box.width * size[0] / windows[0].length
        assert box.height * size[1] / windows[0].height == pytest.approx(metre, rel=1e-9)


def test_the_front_is_in_front(two_avs: RunRecord) -> None:
    """The mark lies ahead of the centre, along the heading."""
    scene = FrameScene(two_avs.log)
    window = scene.windows([10])[0]
    for body in scene.at(int(two_avs.log.ks[10]), window).bodies:
        i = [item.id for item in two_avs.log.descriptions].index(body.id)
        assert body.front is not None
        yaw = two_avs.log.vehicle_states[10, i, 2] - window.yaw
        ahead = body.front.mean(axis=0) - body.corners.mean(axis=0)
        assert np.arctan2(ahead[1], ahead[0]) == pytest.approx(yaw, abs=1e-9)


def test_traces_and_plans_are_the_logs(cut_in: RunRecord) -> None:
    """Traces are the last 2 s of each rear axle; of the plan in force the rest is drawn."""
    log = cut_in.log
    early = np.column_stack((100.0 + np.arange(20.0), np.zeros(20), np.zeros(20)))
    late = early + (0.0, 1.0, 0.0)
    scene = FrameScene(log, {'av0': (FollowedPlan(0.0, 0.0, early),
                                     FollowedPlan(3.05, 3.0, late))})
    window = scene.windows([30])[0]
    frame = scene.at(int(log.ks[30]), window)
    for i, line in enumerate(frame.traces):
        assert _in_map(line.points, window) == pytest.approx(log.vehicle_states[10:31, i, :2])
    # At 3.0 s the second plan has not come yet, and all 30 steps of the first are over.
    assert frame.plans == ()
    (plan,) = scene.at(int(log.ks[32]), window).plans
    assert _in_map(plan.points, window) == pytest.approx(late[2:, :2])
    (plan,) = scene.at(int(log.ks[4]), window).plans
    assert _in_map(plan.points, window) == pytest.approx(early[4:, :2])
    # Dots are half a second apart.
    assert plan.dots == 5


def test_the_road_is_cut_to_the_window(cut_in_scene: FrameScene) -> None:
    """Three lanes of 3.75 m with two lines between them, edges on both sides."""
    window = cut_in_scene.windows([0])[0]
    frame = cut_in_scene.at(int(cut_in_scene.log.ks[0]), window)
    (rings,) = frame.road.surfaces
    assert np.ptp(rings[0][:, 1]) == pytest.approx(3 * 3.75, abs=0.05)
    assert len(frame.road.dashed) == 2
    heights = sorted(float(line[:, 1].mean()) for line in frame.road.edges)
    lines = sorted(float(line[:, 1].mean()) for line in frame.road.dashed)
    assert np.diff([heights[0], *lines, heights[-1]]) == pytest.approx([3.75] * 3, abs=0.05)
    assert all(np.abs(line[:, 0]).max() <= 0.5 * window.length + 1.5
               for line in frame.road.edges)


def test_a_camera_goes_along_where_one_stretch_is_too_long(cut_in: RunRecord) -> None:
    """It stands over 0.4 s and follows the AV over 8 s; both sizes are the same in a figure."""
    scene = FrameScene(cut_in.log)
    near = scene.windows([20, 22, 24])
    assert len(set(near)) == 1
    far = scene.windows([0, 40, 80])
    assert len(set(far)) == 3
    states = cut_in.log.vehicle_states[[0, 40, 80], 1]
    away = [window.to_window(state[None, :2])[0]
            for window, state in zip(far, states, strict=True)]
    np.testing.assert_allclose(away, [away[0]] * 3, atol=1e-9)


def test_a_window_lies_along_the_road(cut_in_scene: FrameScene) -> None:
    """Not along the vehicle in focus, which turns while it changes the lane."""
    log = cut_in_scene.log
    yaws = log.vehicle_states[:, 0, 2]
    windows = cut_in_scene.windows(range(len(log.ks)), [log.vehicles[0].id], follows=True)
    assert np.ptp(yaws) > 0.02
    assert np.ptp([window.yaw for window in windows]) < 1e-3
    assert windows[0].yaw == pytest.approx(float(yaws[0]), abs=0.02)


def test_names_stand_beside_their_vehicles_and_on_none(two_avs: RunRecord) -> None:
    """One name each, whose middle is in no footprint and within 15 m of its vehicle."""
    axes = frames_figure(FrameScene(two_avs.log), two_avs.log.ks[[40]].tolist()).axes[0]
    bodies = _drawn(axes, 'body')
    names = {text.get_text(): text.get_position() for text in axes.texts
             if str(text.get_gid()).startswith('name')}
    assert set(names) == {'hv0', 'av0', 'av1'}
    for name, place in names.items():
        assert np.hypot(*(bodies[name].mean(axis=0) - place)) < 15.0
        for corners in bodies.values():
            assert not ((place > corners.min(axis=0)) & (place < corners.max(axis=0))).all()


def test_panels_tell_their_times(cut_in_scene: FrameScene) -> None:
    """Six panels 0.2 s apart around 3 s; fewer steps where the run ends."""
    ks = panel_steps(cut_in_scene, 3.0, 6, 0.2)
    texts = [axes.texts[-1].get_text() for axes in frames_figure(cut_in_scene, ks).axes]
    assert texts == ['(a) 2.4 s', '(b) 2.6 s', '(c) 2.8 s', '(d) 3.0 s', '(e) 3.2 s',
                     '(f) 3.4 s']
    last = int(cut_in_scene.log.ks[-1])
    assert panel_steps(cut_in_scene, 99.0, 3, 0.5) == (last - 10, last - 5, last)
    assert len(panel_steps(cut_in_scene, 0.0, 60, 0.2)) == 41


def test_an_svg_holds_the_same_footprints(two_avs: RunRecord) -> None:
    """Plain SVG: corners in pixels to a tenth, no script, small; names in it are escaped."""
    scene = FrameScene(two_avs.log)
    window = scene.windows([30])[0]
    frame = scene.at(int(two_avs.log.ks[30]), window)
    text = frame_svg(frame, 600)
    assert len(text) < 8000 and '\n' not in text and text == frame_svg(frame, 600)
    root = ElementTree.fromstring(text)
    colours = {scene.styles[name].colour: name for name in scene.styles}
    scale = 600 / window.length
    found = {}
    for path in root.findall('{http://www.w3.org/2000/svg}path'):
        name = colours.get(path.get('fill', ''))
        if name is not None:
            pixels = np.array([[float(each) for each in pair.split()] for pair in
                               path.get('d', '').strip('Mz').split('L')])
            middle = np.array([float(root.get('width', 0)), float(root.get('height', 0))]) / 2
            found[name] = _in_map((pixels - middle) / scale * (1, -1), window)
    expected = _expected(two_avs.log, 30)
    assert set(found) == set(scene.styles)
    for name, corners in found.items():
        # Half a tenth of a pixel each way.
        assert corners == pytest.approx(expected[name], abs=0.08 / scale)


def test_strange_names_break_no_svg(cut_in: RunRecord) -> None:
    """Ids come from files of unknown authors."""
    log = cut_in.log
    first = log.descriptions[0]
    named = ObjectDescription('<a&"b', first.type, first.role, first.shape, first.rear_to_center)
    scene = FrameScene(replace(log, descriptions=(named, *log.descriptions[1:])))
    text = frame_svg(scene.at(int(log.ks[0]), scene.windows([0])[0]))
    texts = [item.text for item in ElementTree.fromstring(text).iter() if item.text]
    assert '<a&"b' in texts


def test_a_step_that_is_not_in_the_log_is_refused(cut_in_scene: FrameScene) -> None:
    """The error is one line, with the steps that are."""
    window = cut_in_scene.windows([0])[0]
    with pytest.raises(InputError, match='give one of 0 to 80'):
        cut_in_scene.at(81, window)
