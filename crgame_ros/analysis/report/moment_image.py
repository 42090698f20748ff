# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A moment of a run as a picture within HTML."""

from collections.abc import Sequence
from urllib.parse import quote

from crgame_ros.analysis.pictures.critical_moments import Moment
from crgame_ros.analysis.pictures.frame_svg import frame_svg
from crgame_ros.analysis.pictures.scene_frame import FrameScene
from crgame_ros.analysis.report.report_text import plain

# Of a picture [px].
_WIDTH = 560
# What may stand in an address of data in quotes, beside letters and digits.
_SAFE = " =:;/,.-+()!*?@$'"


def moment_image(scene: FrameScene, moment: Moment, driven: Sequence[str]) -> str:
    """
    Draw the scene from above, around those whom a moment is about, as an element `img`.

    :param driven: ids of the driven vehicles, which are named.
    """
    k = scene.k_at(moment.time_s)
    # Each for itself: what it is about is in the middle.
    window = scene.windows([scene.row(k)], moment.vehicles)[0]
    svg = frame_svg(scene.at(k, window, {*driven, *moment.vehicles}), _WIDTH)
    words = f'{moment.time_s:.1f} s: {moment.why}'
    return (f'<img alt="The scene from above at {plain(words)}" '
            f'src="data:image/svg+xml,{quote(svg, safe=_SAFE)}">')
