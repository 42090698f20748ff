# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Access control: addresses, names, origins, tokens."""

from crgame_ros.cockpit.access import Access, cookie_name, is_loopback, is_own_origin
from crgame_ros.cockpit.rights import ALL_RIGHTS
from crgame_ros.errors import InputError
import pytest

TOKEN = 'x' * 32
LOCAL = Access('127.0.0.1', 8000)
OPEN = Access('0.0.0.0', 8000, TOKEN)


@pytest.mark.parametrize('host', ['127.0.0.1', '127.8.0.1', '::1', 'localhost'])
def test_this_machine_needs_no_token(host: str) -> None:
    assert is_loopback(host)
    assert Access.guarded(host, 8000).token is None


@pytest.mark.parametrize('host', ['0.0.0.0', '::', '192.168.1.4', 'lab-pc', 'localhost.evil.com'])
def test_other_machines_need_a_token(host: str) -> None:
    with pytest.raises(InputError, match='open to other machines without a token'):
        Access(host, 8000, None)
    assert len(Access.guarded(host, 8000).token or '') >= 32


def test_a_guessable_token_is_refused() -> None:
    with pytest.raises(InputError, match='fewer than 16'):
        Access('0.0.0.0', 8000, 'secret')


def test_each_token_is_new() -> None:
    assert Access.guarded('0.0.0.0', 1).token != Access.guarded('0.0.0.0', 1).token


def test_the_address_carries_the_token() -> None:
    assert LOCAL.at_port(8003).url == 'http://127.0.0.1:8003/'
    assert OPEN.url.endswith(f':8000/?token={TOKEN}')
    # Others can open this address; they cannot open 0.0.0.0.
    assert not any('0.0.0.0' in url for url in OPEN.urls)
    assert Access('192.0.2.7', 8000, TOKEN).url == f'http://192.0.2.7:8000/?token={TOKEN}'
    assert Access('::1', 80).url == 'http://[::1]:80/'


@pytest.mark.parametrize('token, known', [
    (TOKEN, True), (TOKEN[:-1], False), (TOKEN + 'x', False), ('', False),
    ('\ud800é', False)], ids=['right', 'short', 'long', 'empty', 'no text'])
def test_only_the_right_token_is_known(token: str, known: bool) -> None:
    try:
        cookie = OPEN.exchange(token, None)
    except InputError:
        assert not known
    else:
        assert known
        # The cookie goes to every server of this machine: it is not the token.
        assert cookie != TOKEN and OPEN.rights(cookie) == ALL_RIGHTS
    assert OPEN.rights(token) is None


def test_a_cookie_is_named_after_its_server() -> None:
    assert cookie_name(8080, tls=False) == 'crgame-8080'
    assert cookie_name(8443, tls=True, page='desk') == '__Host-crgame-desk-8443'


@pytest.mark.parametrize('host, allowed', [
    ('127.0.0.1:8000', True), ('localhost:8000', True), ('LOCALHOST:8000', True),
    ('[::1]:8000', True), ('127.0.0.1:8001', False), ('127.0.0.1', False),
    ('evil.example:8000', False), ('localhost.evil.example:8000', False), ('', False),
    ('127.0.0.1:8000@evil.example', False), ('evil.example:8000:8000', False)])
def test_without_token_only_this_machines_names_are_answered(host: str, allowed: bool) -> None:
    assert LOCAL.allows_host(host, 8000) is allowed


def test_port_80_may_be_left_out() -> None:
    assert LOCAL.allows_host('127.0.0.1', 80) and LOCAL.allows_host('[::1]', 80)


def test_with_a_token_the_machine_may_have_any_name() -> None:
    assert OPEN.allows_host('lab-pc.local:8000', 8000)
    assert not OPEN.allows_host('', 8000)


@pytest.mark.parametrize('origin, own', [
    (None, True), ('http://127.0.0.1:8000', True), ('https://127.0.0.1:8000', True),
    ('http://127.0.0.1:8001', False), ('http://localhost:8000', False), ('null', False),
    ('', False), ('file://', False), ('http://127.0.0.1:8000.evil.example', False),
    ('http://127.0.0.1:8000/x', False), ('ftp://127.0.0.1:8000', False), ('http://[', False)])
def test_only_the_servers_own_origin_is_taken(origin: str | None, own: bool) -> None:
    assert is_own_origin(origin, '127.0.0.1:8000') is own
