# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Fewer points with the same extremes, and numbers that arrive as they were sent."""

import base64
from itertools import pairwise
import json

from crgame_ros.analysis.report.document import (
    ALL_POINTS,
    columns_for,
    encoded,
    MOST_COLUMNS,
    script_json,
    thinned,
)
from crgame_ros.analysis.report.section import Plot, PlotLimit, PlotLine, PlotSpan
import numpy as np
import pytest


@pytest.mark.parametrize('seed', range(20))
def test_every_column_keeps_its_extremes_exactly(seed: int) -> None:
    """Against a search column by column."""
    rng = np.random.default_rng(seed)
    xs = np.sort(rng.uniform(3.0, 90.0, 5000))
    ys = rng.normal(size=5000).cumsum()
    ys[rng.uniform(size=5000) < 0.1] = np.nan
    columns = int(rng.integers(7, 200))
    found_xs, found_ys = thinned(xs, ys, columns)
    assert len(found_xs) <= 3 * columns + 2 and (np.diff(found_xs) >= 0.0).all()
    assert found_xs[0] == xs[0] and found_xs[-1] == xs[-1]
    # The remaining points are points of the line.
    place = np.searchsorted(xs, found_xs)
    np.testing.assert_array_equal(ys[place], found_ys)
    edges = np.linspace(xs[0], xs[-1], columns + 1)
    edges[-1] = np.inf
    for low, high in pairwise(edges):
        all_of, left = (values[(at >= low) & (at < high)]
                        for values, at in ((ys, xs), (found_ys, found_xs)))
        if np.isfinite(all_of).any():
            assert np.nanmin(left) == np.nanmin(all_of)
            assert np.nanmax(left) == np.nanmax(all_of)
        assert np.isnan(all_of).any() == np.isnan(left).any()


def test_a_peak_of_one_point_in_twenty_minutes_stays() -> None:
    """This holds at 100 Hz; a short line is unchanged."""
    xs = np.arange(120_000) * 0.01
    ys = np.zeros(120_000)
    ys[77_777], ys[33_333] = 0.123456789, -9.87
    found_xs, found_ys = thinned(xs, ys, MOST_COLUMNS)
    assert (found_ys.min(), found_ys.max()) == (-9.87, 0.123456789)
    assert xs[77_777] in found_xs and xs[33_333] in found_xs
    assert len(found_xs) < 3 * MOST_COLUMNS + 3
    assert len(thinned(xs[:100], ys[:100], 60)[0]) == 100


def test_all_lines_together_have_a_limit() -> None:
    """Few get a column for each pixel, many share."""
    assert columns_for(0) == columns_for(3) == MOST_COLUMNS
    assert 3 * 500 * columns_for(500) <= ALL_POINTS


def test_what_is_encoded_can_be_read_to_the_last_bit() -> None:
    """Values have 64 bits, little-endian; infinite ones are gaps, as in a plot."""
    ys = np.array([1.0 / 3.0, np.inf, -1e-300, np.nan, 7.0])
    found = encoded(Plot('key', 'T', 'm', (PlotLine('hv0', np.arange(5.0), ys, 'av-0'),),
                         (PlotLimit(3.0, 'limit'),), (PlotSpan(1.0, 2.0, 'span', 'warn'),)), 100)
    line = json.loads(script_json(found))['lines'][0]
    read = np.frombuffer(base64.b64decode(line['y']), '<f8')
    np.testing.assert_array_equal(read, [1.0 / 3.0, np.nan, -1e-300, np.nan, 7.0])
    np.testing.assert_array_equal(np.frombuffer(base64.b64decode(line['x']), '<f4'), range(5))
    assert found['limits'] == [{'value': 3.0, 'label': 'limit'}]


def test_the_way_in_a_plane_keeps_its_ends() -> None:
    """This holds for any number of points."""
    xs = np.linspace(0.0, 1.0, 10_001)
    plot = Plot('ways', 'T', 'm', (PlotLine('hv0', xs, 2.0 * xs, 'av-0'),), plane=True)
    line = encoded(plot, 60)['lines'][0]
    ys = np.frombuffer(base64.b64decode(line['y']), '<f8')
    assert len(ys) == 180 and (ys[0], ys[-1]) == (0.0, 2.0)


@pytest.mark.parametrize('text', ['</script><script>alert(1)</script>', '<!--', ']]>', '\u2028&'])
def test_json_cannot_end_its_element(text: str) -> None:
    """It has no characters that HTML interprets, and is read back unchanged."""
    written = script_json({text: [text]})
    assert not set('<>&') & set(written)
    assert json.loads(written) == {text: [text]}
