# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The section that shows a run in frames, at its important moments."""

from urllib.parse import quote

from crgame_ros.analysis.pictures.critical_moments import Moment, nearest_moment
from crgame_ros.analysis.pictures.frame_svg import frame_svg
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.analysis.report.section import free, note, NOTHING, number, plain, Section
from crgame_ros.analysis.runs.run import Run

# Width of a picture [px].
_WIDTH = 560
# Characters that are allowed in a quoted data URL, besides letters and digits.
_SAFE = " =:;/,.-+()!*?@$'"


def moment_image(scene: FrameScene, moment: Moment) -> str:
    """Return an element `img` with the scene from above, around the vehicles of a moment."""
    k = scene.k_at(moment.time_s)
    # Each picture has its own window, centred on the vehicles of its moment.
    window = scene.windows([scene.row(k)], moment.vehicles)[0]
    labelled = {*(item.id for item in scene.log.vehicles), *moment.vehicles}
    svg = frame_svg(scene.at(k, window, labelled), _WIDTH)
    words = f'{moment.time_s:.1f} s: {moment.why}'
    return (f'<img alt="The scene from above at {plain(words)}" '
            f'src="data:image/svg+xml,{quote(svg, safe=_SAFE)}">')


def story_section(run: Run) -> Section | None:
    """Return the section with the scene at each moment; None without a driven vehicle."""
    if not run.log.vehicles:
        return None
    scene = FrameScene(run.log)
    figures = [
        f'<figure class="frame" id="{frame_address(run, place)}" tabindex="-1" '
        f'data-time="{moment.time_s:.6f}">{moment_image(scene, moment)}'
        f'<figcaption><b>{number(moment.time_s, 1)} s</b> {free(moment.why)}</figcaption>'
        '</figure>' for place, moment in enumerate(run.story)]
    return Section('story', 'The story', note(
        'The scene from above at the moments that count, each turned so that the vehicle in focus '
        'drives to the right. Humans are warm, AVs cold colours, all others grey; behind each '
        'driven vehicle is its way of the last two seconds.')
        + f'<div class="frames">{"".join(figures)}</div>')


def frame_address(run: Run, place: int) -> str:
    """Return the address within the page of the frame of a moment."""
    return f'{run.key}-frame-{place + 1}'


def moment(run: Run, time_s: float | None) -> str:
    """Return a time as HTML, linked to the frame that shows it."""
    if time_s is None:
        return NOTHING
    place = nearest_moment(run.story, time_s)
    text = number(time_s, 1)
    if place is None:
        return text
    return f'<a href="#{frame_address(run, place)}" data-time="{time_s:.6f}">{text}</a>'
