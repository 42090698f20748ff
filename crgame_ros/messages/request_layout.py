# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which joints of a plan request belong to whom."""

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass

from crgame_ros.errors import InputError
from crgame_ros.messages.joints import object_joint_names, OBJECT_JOINTS, vehicle_joint_names
import numpy as np
from numpy.typing import NDArray

Index = NDArray[np.intp]


@dataclass(frozen=True)
class RequestLayout:
    """
    The columns of those that an AV is told of; its own are the first four.

    :param ids: (T) who they are
    :param columns: (T, 3) their joints x, y and yaw
    :param where: the topic, for messages
    """

    ids: tuple[str, ...]
    columns: Index
    where: str

    @classmethod
    def of(cls, names: Sequence[str], av: str, where: str = '') -> 'RequestLayout':
        """
        Read joint names.

        :param av: whose request it has to be.
        :param where: the topic, for messages.
        :raises InputError: if it is another vehicle's, or somebody lacks a joint.
        """
        where = where or f'/{av}/plan_request'
        own = vehicle_joint_names(av)
        if tuple(names[:len(own)]) != own:
            raise InputError('does not begin with ' + ', '.join(own), where)
        place = {name: index for index, name in enumerate(names)}
        ids = tuple(dict.fromkeys(name.rpartition('/')[0] for name in names[len(own):]))
        columns = []
        for object_id in ids:
            joints = object_joint_names(object_id)
            if not place.keys() >= {*joints}:
                raise InputError(f'object "{object_id[:40]}" lacks a joint', where,
                                 'name ' + ', '.join(joints)[:120])
            columns.append([place[joint] for joint in joints])
        return cls(ids, np.array(columns, dtype=np.intp).reshape(-1, len(OBJECT_JOINTS)), where)

    def indices(self, index: Mapping[str, int]) -> Index:
        """
        Return everybody's index (T).

        :raises InputError: if somebody has none.
        """
        for object_id in self.ids:
            if object_id not in index:
                raise InputError(f'object "{object_id[:40]}" is not described', self.where,
                                 'publish it on /scenario/objects first')
        return np.array([index[object_id] for object_id in self.ids], dtype=np.intp)

    def among(self, known: Container[str]) -> 'RequestLayout':
        """Leave out whoever is not known."""
        kept = [number for number, object_id in enumerate(self.ids) if object_id in known]
        return RequestLayout(tuple(self.ids[number] for number in kept), self.columns[kept],
                             self.where)
