# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The optional packages of instruments, and what to do where they are missing."""

from importlib.util import find_spec

from crgame_ros.errors import InputError
from crgame_ros.game.instruments_spec import InstrumentsSpec
from crgame_ros.paths import extra_install

INSTALL = extra_install('instruments')
_LIBRARY = ('install liblsl 1.17.7 or newer (https://github.com/sccn/liblsl/releases), or name '
            'its file in PYLSL_LIB')


def require_instruments(spec: InstrumentsSpec) -> None:
    """
    Check that what a game's instruments need is installed.

    :raises InputError: if it is not, with what installs it.
    """
    if spec.streams:
        _require_lsl()
    if spec.triggers is not None and spec.triggers.port is not None \
            and find_spec('serial') is None:
        raise InputError('needs the package pyserial, which is not installed',
                         'instruments: triggers: port', INSTALL)


def _require_lsl() -> None:
    if find_spec('pylsl') is None:
        raise InputError('needs the package pylsl, which is not installed', 'instruments', INSTALL)
    try:
        import pylsl  # noqa: F401
    except (ImportError, RuntimeError, OSError) as error:
        # Its wheel for this platform may lack the library itself.
        raise InputError(f'pylsl cannot load liblsl ({error})', 'instruments', _LIBRARY) from error
