# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Participants of a recruiting platform: their ids, and the codes by which they are paid."""

from dataclasses import dataclass
import hmac
from pathlib import Path
import secrets
from typing import Annotated

from crgame_ros.errors import InputError, refusing
from crgame_ros.schema.marks import Wording
from crgame_ros.whole_file import write_bytes

# In the folder of a study; only its owner can read it.
PRIVATE, _KEY = '.private', 'platform.key'
_KEY_BYTES = 32
# 48 bits: of 10000 participants, two have one id with a probability of 2e-7.
_ID_DIGITS = 12
# A platform's id of a participant, or a code of it.
_CODE = Wording('[A-Za-z0-9_-]{1,64}', 'give 1 to 64 letters, digits, - and _')
_HERE = '{code}'


@dataclass(frozen=True)
class Elsewhere:
    """
    How a recruiting platform sends participants, and where they go at the end.

    :param id_from: key of the link's query with the platform's id of the participant, such as
        PROLIFIC_PID.
    :param completion_code: shown after the last item.
    :param screen_out_code: shown to participants who are excluded; by default no code is.
    :param completed_address: where a link leads at the end; `{code}` stands for the code.
    """

    id_from: Annotated[str, Wording('[A-Za-z][A-Za-z0-9_]{0,39}',
                                    'begin with a letter, then letters, digits and _')]
    completion_code: Annotated[str, _CODE]
    screen_out_code: Annotated[str, _CODE] | None = None
    completed_address: Annotated[str, Wording(
        r'https://[A-Za-z0-9.-]+(:[0-9]{1,5})?(/[!-~]{0,300})?',
        'give an address that begins with https://')] | None = None

    def check(self) -> None:
        """Refuse the key of the links' own secret."""
        if self.id_from == 'token':
            raise InputError('is taken by the link itself', 'id_from', 'take another key')

    def code_for(self, how: str) -> str:
        """
        Return the code of a session that is over; empty without one.

        :param how: done, excluded, declined or ended.
        """
        return {'done': self.completion_code, 'excluded': self.screen_out_code or ''}.get(how, '')

    def address_for(self, how: str) -> str:
        """Return where the participant goes then; empty without a code or an address."""
        code = self.code_for(how)
        return (self.completed_address or '').replace(_HERE, code) if code else ''


def private_folder(root: Path) -> Path:
    """
    Return the folder of a study's secrets, which is created if it is missing.

    :param root: folder of the study.
    :raises InputError: if it cannot be created.
    """
    folder = root / PRIVATE
    with refusing('cannot be made', folder, 'choose another folder with --out'):
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    return folder


class PlatformIds:
    """
    The ids of a study's participants who come from a platform.

    The platform's ids are kept nowhere: ours are made of them by a secret of the study (HMAC,
    RFC 2104, with SHA-256), so equal ones stay equal, and nobody without the secret can tell
    which is whose.

    :param root: folder of the study.
    :raises InputError: if the secret is not there, or cannot be read.
    """

    def __init__(self, root: Path) -> None:
        path = root / PRIVATE / _KEY
        try:
            self._key = path.read_bytes()
        except FileNotFoundError as error:
            raise InputError('has received nobody yet', str(root),
                             'name the folder with --out, or begin with --listen') from error
        except OSError as error:
            raise InputError(f'cannot be read ({error.strerror})', str(path),
                             'make it readable') from error
        if len(self._key) != _KEY_BYTES:
            raise InputError('is no key of this program', str(path), 'put it back')

    @classmethod
    def begun(cls, root: Path) -> 'PlatformIds':
        """
        Make the secret, unless it is there.

        :raises InputError: if it cannot be written or read.
        """
        path = private_folder(root) / _KEY
        if not path.exists():
            write_bytes(secrets.token_bytes(_KEY_BYTES), path)
        return cls(root)

    @property
    def token(self) -> str:
        """Return the secret of the address that the platform gets, always the same."""
        return self._digest('address')[:32]

    def own_id(self, given: str) -> str:
        """
        Return the id of a participant in the study.

        :param given: the platform's id.
        :raises InputError: if it is none.
        """
        if not _CODE.fits(given):
            raise InputError('is no id of a platform', given[:40], _CODE.remedy)
        return f'E{self._digest(f"participant {given}")[:_ID_DIGITS]}'

    def _digest(self, text: str) -> str:
        return hmac.new(self._key, text.encode(), 'sha256').hexdigest()
