# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The formats of an exported run: which one is meant, and what it needs."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from crgame_ros.errors import InputError
from crgame_ros.paths import extra_install

COMMONROAD, OPENSCENARIO = '.xml', '.xosc'
# Endings of files, by the names of their formats.
FORMATS: Mapping[str, str] = MappingProxyType({'commonroad': COMMONROAD,
                                               'openscenario': OPENSCENARIO})


def chosen_format(out: Path | None, name: str | None) -> str:
    """
    Return the ending of the format that is meant.

    :param out: the file or folder that is named, if any.
    :param name: the format that is named, if any; one of `FORMATS`.
    :raises InputError: if both are named and differ.
    """
    ending = out.suffix if out is not None and out.suffix in FORMATS.values() else None
    if ending is not None and name is not None and FORMATS[name] != ending:
        raise InputError(f'is {name}, and the file ends in {ending}', '--format',
                         f'name a folder or a file that ends in {FORMATS[name]}')
    return ending or FORMATS[name or 'commonroad']


def require_openscenario() -> None:
    """
    Check that the library for OpenSCENARIO is installed.

    :raises InputError: if it is not, with the command that installs it.
    """
    try:
        import scenariogeneration  # noqa: F401
    except ImportError as error:
        raise InputError(f'needs scenariogeneration ({error})', 'OpenSCENARIO',
                         extra_install('openscenario')) from error
