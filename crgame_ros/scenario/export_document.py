# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Puts a scenario file together, and checks it by CommonRoad's schema."""

from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

from crgame_ros.errors import CrgameError
from crgame_ros.scenario.export_elements import exact_number
from crgame_ros.scenario.export_network import schema_errors
from lxml import etree

_ERRORS_TOLD = 3
# Of files without a day of their own: equal content gives equal bytes.
NO_DAY = '1970-01-01'
# When a dynamic obstacle begins.
_BEGINNINGS = tuple(f'dynamicObstacle/{state}/time/exact'
                    for state in ('initialState', 'initialSignalState'))


def scenario_header(benchmark_id: str, time_step_s: float, source: str, *, author: str = '',
                    affiliation: str = '', day: str = NO_DAY) -> dict[str, str]:
    """Return the attributes of the root element of a CommonRoad 2020a file."""
    return {'timeStepSize': exact_number(time_step_s), 'commonRoadVersion': '2020a',
            'author': author, 'affiliation': affiliation, 'source': source,
            'benchmarkID': benchmark_id, 'date': day}


def document_text(header: dict[str, str], content: str) -> str:
    """Return the text of a file, unchecked."""
    attributes = ' '.join(f'{name}={quoteattr(value)}' for name, value in header.items())
    return (f"<?xml version='1.0' encoding='UTF-8'?>\n<commonRoad {attributes}>\n{content}"
            '</commonRoad>\n')


def refuse_invalid(text: str, late: bool = False) -> None:
    """
    Refuse a file that violates the schema.

    :param late: as of `scenario_document`.
    :raises CrgameError: naming the first errors.
    """
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
    roads = ''.join(etree.tostring(element, encoding='unicode').rstrip() + '\n'
                    for element in network)
    text = document_text(header, roads + rest)
    refuse_invalid(text, late)
    return text
