# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The description of a run: `/scenario/xml`, `/scenario/objects` and `/scenario/game` together."""

from collections.abc import Mapping
from dataclasses import dataclass

from crgame_ros.errors import InputError
from crgame_ros.game.documents import GAME, GameDocument, OBJECTS
from crgame_ros.game.objects import driven_and_others, ObjectDescription
from crgame_ros.ros.endpoints import Endpoints
from crgame_ros.scenario.loading import LoadedScenario, parse_scenario, scenario_digest

# The game is read first: it is published last, so that the documents it refers to are mostly
# there.
KINDS = ('game', 'xml', 'objects')


@dataclass(frozen=True)
class ScenarioSet:
    """
    Documents that belong together.

    :param loaded: the scenario; the same object as before while its text is the same.
    :param objects: all objects that can appear; the driven vehicles are those of the game.
    :param texts: the documents as they came: xml, objects, game.
    """

    loaded: LoadedScenario
    objects: tuple[ObjectDescription, ...]
    game: GameDocument
    texts: Mapping[str, str]

    @property
    def driven(self) -> tuple[ObjectDescription, ...]:
        """Return the driven vehicles, in the order of `/vehicles/state`."""
        return driven_and_others(self.objects)[0]

    @property
    def others(self) -> tuple[ObjectDescription, ...]:
        """Return all other objects, in the order of `/traffic/objects`."""
        return driven_and_others(self.objects)[1]


class DocumentCollector:
    """The collector of matching documents, in whatever order they come."""

    def __init__(self) -> None:
        self._texts: dict[str, str] = {}
        self._given: dict[str, str] = {}
        self._loaded: LoadedScenario | None = None

    def add(self, kind: str, text: str) -> None:
        """
        Add a document.

        :param kind: xml, objects or game.
        :raises InputError: if it cannot be read; the previous one stays.
        """
        if kind == 'game':
            GAME.read(text)
        elif kind == 'objects':
            OBJECTS.read(text)
        self._texts[kind] = text

    def complete(self) -> ScenarioSet | None:
        """
        Return the set, once, when the documents match and one of them is new.

        :raises CrgameError: if a document cannot be read.
        """
        if len(self._texts) < len(KINDS) or self._texts == self._given:
            return None
        game = GAME.read(self._texts['game'])
        if scenario_digest(self._texts['xml']) != game.scenario_sha256:
            return None
        objects = OBJECTS.read(self._texts['objects'])
        if [item.id for item in driven_and_others(objects)[0]] \
                != [item.id for item in game.vehicles]:
            return None
        if self._loaded is None or self._loaded.sha256 != game.scenario_sha256:
            self._loaded = parse_scenario(self._texts['xml'], '/scenario/xml')
        self._given = dict(self._texts)
        return ScenarioSet(self._loaded, objects, game, dict(self._texts))


class ScenarioDocuments:
    """The three documents, read without an executor."""

    def __init__(self, endpoints: Endpoints) -> None:
        self._slots = {kind: endpoints.polled(f'/scenario/{kind}') for kind in KINDS}
        self._refusals = endpoints.refusals
        self._collector = DocumentCollector()

    def poll(self) -> ScenarioSet | None:
        """
        Return a new complete set; None while there is nothing new.

        A game or list of objects that cannot be read is refused and counted.

        :raises CrgameError: if the scenario of a game cannot be read.
        """
        fresh = False
        for kind, slot in self._slots.items():
            if (document := slot.latest()) is not None:
                try:
                    self._collector.add(kind, document.data)
                    fresh = True
                except InputError as error:
                    # The previous one goes on.
                    self._refusals.note(f'/scenario/{kind}', str(error))
        return self._collector.complete() if fresh else None
