# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A drive of a study: its game, written for the graph, and where it is recorded."""

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import urlencode

from crgame_ros.driver.source import COCKPIT
from crgame_ros.game.game_file import dump_game
from crgame_ros.study.session_script import PracticeDrives, SessionItem
from crgame_ros.study.trial_game import seat_of, trial_game
from crgame_ros.study.trial_plan import PlannedTrial
from crgame_ros.study.trial_settings import TrialSettings
from crgame_ros.whole_file import write_whole


def settings_of(item: SessionItem) -> TrialSettings | None:
    """Return the settings of an item that is driven; None of others."""
    if isinstance(item.what, PlannedTrial):
        return item.what.condition.settings
    return item.what.settings if isinstance(item.what, PracticeDrives) else None


@dataclass(frozen=True)
class StudyDrive:
    """
    An item of a session that is driven.

    :param item: of the session.
    :param settings: of it.
    :param seat: the vehicle that the participant drives.
    :param game: file of its game.
    """

    item: SessionItem
    settings: TrialSettings
    seat: str
    game: Path

    def link(self, cockpit: str, language: str, key: str) -> str:
        """
        Return the address of the cockpit's page as the participant sees it.

        :param key: by which the cockpit knows the participant again, in whatever browser.
        """
        settings = self.settings
        shown = {name: int(bool(getattr(settings, name)))
                 for name in ('map', 'names', 'plans', 'sound')}
        return f'{cockpit.rstrip("/")}/?' + urlencode(
            {'stage': self.seat, 'view': settings.view or 'driver', **shown,
             'lang': language, 'key': key})


def write_drive(item: SessionItem, games: Path) -> StudyDrive | None:
    """
    Write the game of an item.

    :param games: folder of the participant's games.
    :return: None if the item is not driven.
    :raises InputError: if its game cannot be used.
    """
    settings = settings_of(item)
    if settings is None:
        return None
    game = trial_game(settings, COCKPIT)
    path = games / f'{item.id.replace("/", "_")}.yaml'
    text = dump_game(game)
    games.mkdir(parents=True, exist_ok=True)
    write_whole(text.encode(), path)
    return StudyDrive(item, settings, seat_of(settings, game), path)
