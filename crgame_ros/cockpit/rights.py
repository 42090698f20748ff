# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The rights of a person at a page: direct the experiment, drive, or watch."""

from dataclasses import dataclass, replace

# The roles that a page, a link or the address may request.
ROLES = ('direct', 'drive', 'watch', 'all')
_DIRECTS = ('control', 'rate', 'planner', 'trigger')
_DRIVES = ('input', 'claim', 'release', 'ask', 'hand_over', 'answer', 'ready', 'device',
           'task', 'picture')
_DEEDS = {'start': 'start the run', 'pause': 'pause the run', 'step': 'step through the run',
          'reset': 'reset the run', 'stop': 'stop the run', 'rate': 'change the speed of time',
          'planner': 'stop a planner or let it go on', 'trigger': 'trigger events',
          'load': 'choose what is run', 'invite': 'make links', 'delete': 'delete runs'}


@dataclass(frozen=True)
class Rights:
    """
    The rights of one person.

    :param directs: controls the experiment: run control, scenarios, planners, events, links.
    :param drives: may take a seat.
    :param seat: the only seat that may be taken without being offered; empty for any.
    """

    directs: bool = True
    drives: bool = True
    seat: str = ''

    @classmethod
    def for_role(cls, role: str, seat: str = '') -> 'Rights':
        """Return the rights of a role: direct, drive, watch or all."""
        return cls(role in ('direct', 'all'), role in ('drive', 'all'), seat)

    @property
    def role(self) -> str:
        """Return the role in words."""
        words = [word for has, word in ((self.directs, 'director'), (self.drives, 'driver'))
                 if has]
        return ' and '.join(words) or 'spectator'

    def narrowed(self, role: str) -> 'Rights':
        """Return the rights of a role, limited to these rights."""
        wanted = Rights.for_role(role)
        return replace(self, directs=self.directs and wanted.directs,
                       drives=self.drives and wanted.drives)

    def refusal(self, kind: str, action: str = '') -> str:
        """
        Return why an action is refused; empty if it is allowed.

        :param kind: kind of a message, or load, invite, runs or delete.
        :param action: action of the run control.
        """
        deed = _DEEDS.get(action or kind, '')
        if kind == 'control' and action == 'start' and (self.directs or self.drives):
            # A driver starts to report ready; the handler of the order refuses any other start.
            return ''
        if kind == 'runs' and not (self.directs or self.drives):
            return f'only a driver or a director can look at past runs; you are a {self.role}'
        if kind in (*_DIRECTS, 'load', 'invite', 'delete') and not self.directs:
            return f'only a director can {deed}; you are a {self.role}'
        if kind in _DRIVES and not self.drives:
            return f'only a driver can take a seat; you are a {self.role}'
        return ''


ALL_RIGHTS = Rights()
