# Copyright 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Which joints of a plan request belong to which thing."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from crgame_ros.errors import InputError
from crgame_ros.planner.joints import object_joint_names, vehicle_joint_names

Index = NDArray[np.intp]


@dataclass(frozen=True)
class RequestLayout:
    """
    The columns of a request's things, the AV itself (columns 0 to 3) left out.

    :param things: (T) their indices among all descriptions
    :param columns: (T, 3) their joints x, y and yaw
    """

    things: Index
    columns: Index

    @classmethod
    def of(cls, names: tuple[str, ...], vehicle_id: str, ids: Sequence[str]) -> 'RequestLayout':
        """
        Read joint names.

        :param ids: of all descriptions, in their order
        :raises InputError: if the request is another vehicle's, or names something unknown.
        """
        where = f'/{vehicle_id}/true_request'
        own = vehicle_joint_names(vehicle_id)
        if names[:len(own)] != own:
            raise InputError('does not begin with ' + ', '.join(own), where)
        number = {name: index for index, name in enumerate(ids)}
        place = {name: index for index, name in enumerate(names)}
        found = list(dict.fromkeys(name.rpartition('/')[0] for name in names[len(own):]))
        for object_id in found:
            if object_id not in number or not place.keys() >= {*object_joint_names(object_id)}:
                raise InputError(f'object "{object_id[:40]}" is not described, or lacks a joint',
                                 where, 'publish it on /scenario/objects first')
        columns = [[place[joint] for joint in object_joint_names(object_id)]
                   for object_id in found]
        return cls(np.array([number[object_id] for object_id in found], dtype=np.intp),
                   np.array(columns, dtype=np.intp).reshape(-1, 3))
