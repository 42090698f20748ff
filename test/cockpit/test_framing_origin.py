# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The origins that are accepted for a page that frames the cockpit's page."""

from crgame_ros.cockpit.framing_origin import read_origin
from crgame_ros.errors import InputError
import pytest


@pytest.mark.parametrize(('text', 'origin'), [
    ('http://127.0.0.1:8070', 'http://127.0.0.1:8070'), ('HTTP://LocalHost', 'http://localhost'),
    ('https://lab-pc.example:443/', 'https://lab-pc.example'),
    ('http://127.0.0.1:80', 'http://127.0.0.1'), ('https://a:80', 'https://a:80'),
    ('http://[::1]:8070', 'http://[::1]:8070'), (' http://a:08070 ', 'http://a:8070')])
def test_an_origin_is_written_as_browsers_do(text: str, origin: str) -> None:
    assert read_origin(text) == origin


@pytest.mark.parametrize('text', [
    '', '*', 'http://*', 'http://*.example', '127.0.0.1:8070', 'ftp://a', 'http://', 'http://a/b',
    'http://a:1/?b', 'http://u:p@a:1', "http://a 'self'", 'http://a; script-src *', 'http://a:0',
    'http://a:65536', 'http://a:', 'http://-a', 'http://a..b', 'http://[127.0.0.1]',
    'http://[::1', 'http://[:::1]', 'null', 'http://a,http://b', 'http://a\nX: b', 'data:a'])
def test_whatever_else_is_refused(text: str) -> None:
    """The value becomes part of a header, which must name one origin only."""
    with pytest.raises(InputError, match='is no origin'):
        read_origin(text)
