# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The messages of the desk's pages: untrusted JSON becomes one of these, or one clear error."""

from typing import Annotated, Literal

from crgame_ros.schema.document_marks import Bounded
from crgame_ros.schema.messages import HexKey, Message, MessageId, MessageReader, Words
from pydantic import AfterValidator, Field, StringConstraints

# Enough for a page of questions with long texts, at four bytes per character.
MAX_BYTES = 4 * 2 ** 20
_MAX_ANSWERS = 500


def _not_blank(text: str) -> str:
    if not text.strip():
        raise ValueError('is empty')
    return text


ShortText = Annotated[Words, StringConstraints(max_length=200)]
Remark = Annotated[Words, StringConstraints(max_length=20_000), AfterValidator(_not_blank)]
Seconds = Annotated[float, Field(ge=0.0, le=1e11)]
Milliseconds = Annotated[float, Field(ge=0.0, le=60_000.0)]
Choices = Annotated[list[ShortText], Bounded(500)]


class Ping(Message):
    """
    A request for a pong, with what the page has measured.

    :param t: of the page's own clock, comes back.
    :param round_trip_ms: from the last ping to its pong [ms]
    :param drive_delay_ms: the same of the page with the drive, inside this one [ms]
    :param seated: whether the participant has the seat.
    """

    type: Literal['ping'] = 'ping'  # noqa: A003
    t: float
    round_trip_ms: Milliseconds | None = None
    drive_delay_ms: Milliseconds | None = None
    seated: bool | None = None


class Hello(Message):
    """
    A participant's page is there.

    :param page: constant for the page.
    :param fresh: whether it was just opened.
    """

    type: Literal['hello'] = 'hello'  # noqa: A003
    page: HexKey
    fresh: bool


class Here(Message):
    """The participant takes part at this page, of several."""

    type: Literal['here'] = 'here'  # noqa: A003


class Language(Message):
    """The language of the participant, or of the experimenter's page."""

    type: Literal['language'] = 'language'  # noqa: A003
    language: Annotated[Words, StringConstraints(max_length=20)]


class Ready(Message):
    """The participant is ready for a drive."""

    type: Literal['ready'] = 'ready'  # noqa: A003
    item: ShortText


class Finish(Message):
    """
    The participant has finished an item that is not driven.

    :param item: its id.
    :param answers: by question.
    :param shown_at: when it was shown, by the wall clock [s since 1970]
    :param answered_at: when it was finished [s since 1970]
    :param taken_s: time between both, without pauses [s]
    :param after_s: time from the beginning to each question's answer [s]
    :param agreed: to a consent.
    :param device: that was found.
    :param moved: its controls that have been moved.
    """

    type: Literal['finish'] = 'finish'  # noqa: A003
    item: ShortText
    answers: Annotated[dict[ShortText, int | float | Words | Choices | None],
                       Bounded(_MAX_ANSWERS)] = {}
    shown_at: Seconds
    answered_at: Seconds
    taken_s: Seconds
    after_s: Annotated[dict[ShortText, Seconds], Bounded(_MAX_ANSWERS)] = {}
    agreed: bool | None = None
    device: ShortText | None = None
    moved: Annotated[list[ShortText], Bounded(50)] = []

    def told(self) -> dict[str, object]:
        """Return what is recorded beside the answers."""
        without = {'type', 'item', 'answers', 'agreed'}
        return self.model_dump(exclude=without | ({'device', 'moved'} if self.device is None
                                                  else set()))


class Order(Message):
    """A message of the experimenter, which gets a reply."""

    id: MessageId  # noqa: A003


class Note(Order):
    """A note about the session."""

    type: Literal['note'] = 'note'  # noqa: A003
    text: Remark


class Mark(Order):
    """A marker in the recording."""

    type: Literal['mark'] = 'mark'  # noqa: A003
    name: Annotated[Words, StringConstraints(max_length=200, strip_whitespace=True, min_length=1)]


class Reasoned(Order):
    """An item is driven again, is left out, or ends early."""

    type: Literal['repeat', 'skip', 'abort']  # noqa: A003
    item: ShortText
    reason: Remark


class End(Order):
    """The session ends early."""

    type: Literal['end'] = 'end'  # noqa: A003
    reason: Remark


class Hold(Order):
    """The session stops after the present item, or goes on."""

    type: Literal['hold'] = 'hold'  # noqa: A003
    held: bool


ParticipantMessage = Hello | Here | Language | Ready | Finish | Ping
ExperimenterOrder = Note | Mark | Reasoned | End | Hold
ExperimenterMessage = ExperimenterOrder | Language | Ping
# They read one JSON object of at most `MAX_BYTES` each.
FROM_PARTICIPANT: MessageReader[ParticipantMessage] = MessageReader(ParticipantMessage)
FROM_EXPERIMENTER: MessageReader[ExperimenterMessage] = MessageReader(ExperimenterMessage)
