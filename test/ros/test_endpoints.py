# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Endpoints of a run go with it; those of its node stay."""

from crgame_ros.ros.endpoints import Endpoints
import rclpy
from rclpy.context import Context
from ros_domains import own_domain_id


def test_endpoints_destroy_what_they_have_created_and_nothing_else() -> None:
    """Each run of a node has its own; the diagnostics of the first ones belong to the node."""
    context = Context()
    rclpy.init(context=context, domain_id=own_domain_id())
    node = rclpy.create_node('owner', context=context)

    def there() -> list[int]:
        return [len(list(each)) for each in (node.publishers, node.subscriptions, node.services)]

    bare = there()
    first = Endpoints(node)
    first.polled('/trigger')
    first.destroy()
    told = there()
    assert told == [bare[0] + 1, *bare[1:]], 'the publisher of /diagnostics'
    second = Endpoints(node)
    second.publisher('/trigger')
    second.polled('/trigger')
    second.subscription('/seats/order', print)
    second.service('/sim/start', lambda _, response: response)
    second.release(second.polled('/clock'))
    kept = first.polled('/trigger')
    assert there() == [told[0] + 1, told[1] + 3, told[2] + 1]
    second.destroy()
    assert there() == [told[0], told[1] + 1, told[2]]
    assert kept.latest() is None
    node.destroy_node()
    rclpy.try_shutdown(context=context)
