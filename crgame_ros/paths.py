# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The paths of the data files (config, pages, scenarios, contract), and checks of files."""

from collections.abc import Iterator
import errno
from itertools import count
import os
from pathlib import Path
import stat
import sys
import tempfile
from typing import Literal

from crgame_ros.errors import CrgameError, InputError, refusing

PACKAGE = 'crgame_ros'


def share_directory() -> Path:
    """
    Find the package's share directory: the source tree, a colcon install or a pip install.

    :raises CrgameError: if the data files were not installed.
    """
    package = Path(__file__).resolve().parent
    candidates = [package.parent]
    candidates += [parent / 'share' / PACKAGE for parent in package.parents]
    candidates.append(Path(sys.prefix) / 'share' / PACKAGE)
    for candidate in candidates:
        if (candidate / 'msg_defs' / 'interfaces.yaml').is_file():
            return candidate
    raise CrgameError(f'{package}: the data files of {PACKAGE} are missing; '
                      'install with colcon or `pip install .`, or run from the source tree')


def expanded(name: str | Path) -> Path:
    """
    Return a path in which a leading `~` or `~NAME` is the home folder of that user.

    :raises InputError: if there is no such user.
    """
    try:
        return Path(name).expanduser()
    except RuntimeError as error:
        raise InputError('is in the home folder of nobody here', str(name),
                         'write out where it is') from error


def numbered(wanted: Path) -> Iterator[Path]:
    """Yield a name, then the same with _2, _3, …, so that existing files stay as they are."""
    yield wanted
    for number in count(2):
        yield wanted.with_name(f'{wanted.name}_{number}')


def irregular(mode: int) -> str | None:
    """Return the kind of a file that is not to be read, by its mode: a pipe may never end."""
    if stat.S_ISDIR(mode):
        return 'a directory'
    return None if stat.S_ISREG(mode) else 'no regular file'


def check_room(folder: Path, size: int = 1 << 20) -> None:
    """
    Check that data can be stored in a folder, before the work that produces them.

    :param size: of the trial file [bytes]
    :raises OSError: if the disk is full, a quota is used up or the folder cannot be written.
    """
    with tempfile.TemporaryFile(dir=folder) as stream:
        try:
            os.posix_fallocate(stream.fileno(), 0, size)
        except OSError as error:
            # Some file systems cannot reserve space.
            if error.errno not in (errno.EOPNOTSUPP, errno.EINVAL, errno.ENOSYS):
                raise


def user_directory(kind: Literal['cache', 'config', 'data']) -> Path:
    """Return this package's folder among the user's, by the XDG base directory specification."""
    usual = {'cache': '.cache', 'config': '.config', 'data': '.local/share'}[kind]
    return Path(os.environ.get(f'XDG_{kind.upper()}_HOME') or Path.home() / usual) / PACKAGE


def make_folder(folder: Path, remedy: str) -> None:
    """
    Make a folder, with those above it, unless it is there.

    :raises InputError: if it cannot be made.
    """
    with refusing('cannot be made', folder, remedy):
        folder.mkdir(parents=True, exist_ok=True)


def extra_install(extra: str) -> str:
    """
    Return the command that installs an optional part.

    :param extra: its name among the optional dependencies of pyproject.toml.
    """
    uv = Path(sys.prefix) / 'bin' / 'uv'
    if uv.exists():
        return f'{uv} pip install -c requirements-dev.txt -r pyproject.toml --extra {extra}'
    return f"pip install '.[{extra}]'"


def config_directory() -> Path:
    """Find the directory of configuration files."""
    return share_directory() / 'config'


def page_directory() -> Path:
    """Find the directory of the pages that browsers get: one folder for each."""
    return share_directory() / 'page'


def scenarios_directory() -> Path:
    """Find the directory of the package's own scenarios and game files."""
    return share_directory() / 'scenarios'


def own_games() -> dict[str, Path]:
    """Return the files of the package's own games by their names, such as cut_in, sorted."""
    # A name with a dot is that of a driver's timeline.
    return {path.stem: path for path in sorted(scenarios_directory().glob('*.yaml'))
            if '.' not in path.stem}


def find_game(name: Path) -> Path:
    """
    Return the file of a game: the one named, or the package's own game of that name (`cut_in`).

    :raises InputError: if it is neither.
    """
    if name.suffix or len(name.parts) > 1 or name.is_file():
        return name
    own = own_games()
    if name.name not in own:
        raise InputError('is neither a file nor one of the games of this package', str(name),
                         'these are ' + ', '.join(own))
    return own[name.name]


def default_game() -> Path:
    """Find the game that runs when none is named."""
    return scenarios_directory() / 'cut_in.yaml'
