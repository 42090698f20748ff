# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Puts a scenario file together, and checks it by CommonRoad's schema."""

from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

from crgame_ros.errors import CrgameError
from crgame_ros.scenario.export_network import schema_errors
from lxml import etree

_ERRORS_TOLD = 3
# When a dynamic obstacle begins.
_BEGINNINGS = tuple(f'dynamicObstacle/{state}/time/exact'
                    for state in ('initialState', 'initialSignalState'))


def scenario_document(header: dict[str, str], network: Sequence[etree._Element], rest: str,
                      late: bool = False) -> str:
    """
    Return the text of a CommonRoad 2020a file.

    :param header: attributes of the root element.
    :param network: location, tags, lanelets, signs, lights, intersections.
    :param rest: XML of obstacles and planning problems.
    :param late: whether dynamic obstacles may begin after time step 0, which the schema forbids
        and published scenarios with recorded traffic do.
    :raises CrgameError: if it violates the schema.
    """
    attributes = ' '.join(f'{name}={quoteattr(value)}' for name, value in header.items())
    roads = ''.join(etree.tostring(element, encoding='unicode').rstrip() + '\n'
                    for element in network)
    text = (f"<?xml version='1.0' encoding='UTF-8'?>\n<commonRoad {attributes}>\n"
            f'{roads}{rest}</commonRoad>\n')
    try:
        root = etree.fromstring(text.encode('utf-8'), etree.XMLParser(huge_tree=True))
        for path in _BEGINNINGS if late else ():
            for element in root.iterfind(path):
                element.text = '0'
        errors = schema_errors(root)
    except etree.XMLSyntaxError as error:
        errors = [str(error)]
    if errors:
        raise CrgameError('the scenario would break the CommonRoad schema: '
                          + '; '.join(errors[:_ERRORS_TOLD]))
    return text
