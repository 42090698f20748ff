# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""On which side of the road traffic keeps, and what follows from that."""

from typing import NamedTuple

from commonroad.scenario.lanelet import LaneletNetwork
from commonroad.scenario.scenario import Scenario

# ISO 3166-1 alpha-3 codes of countries and territories that drive on the left, after the table of
# Wikipedia's "Left- and right-hand traffic". ZAM is no code of ISO but CommonRoad's own country.
LEFT_HAND = frozenset("""
    AIA ATG AUS BGD BHS BMU BRB BRN BTN BWA CCK COK CXR CYM CYP DMA FJI FLK GBR GGY GRD GUY HKG IDN
    IMN IND IRL JAM JEY JPN KEN KIR KNA LCA LKA LSO MAC MDV MLT MOZ MSR MUS MWI MYS NAM NFK NIU NPL
    NRU NZL PAK PCN PNG SGP SHN SLB SUR SWZ SYC TCA THA TKL TLS TON TTO TUV TZA UGA VCT VGB VIR WSM
    ZAF ZMB ZWE
""".split())
# Of these, where the law gives priority to the right all the same: Australian Road Rules 72; the
# Indian Rules of the Road Regulations 1989, 9; the Irish S.I. 182/1997, 8; New Zealand's Land
# Transport (Road User) Rule 2004, 4.2. The Vienna Convention, 18 (4), leaves it to each of them.
PRIORITY_TO_THE_RIGHT = frozenset({'AUS', 'IND', 'IRL', 'NZL'})


class DrivingSide(NamedTuple):
    """
    What traffic does where.

    :param keeps_left: on which side of the road it drives.
    :param priority_to_left: whether, without signs, who comes from the left goes first.
    """

    keeps_left: bool = False
    priority_to_left: bool = False


RIGHT_HAND = DrivingSide()


def driving_side(scenario: Scenario) -> DrivingSide:
    """
    Return on which side traffic keeps: as the neighbours of its lanes do, or else its country.

    Own maps, and published ones that were mirrored, may drive on another side than their country.
    """
    country = str(scenario.scenario_id.country_id)
    keeps_left = _by_neighbours(scenario.lanelet_network)
    if keeps_left is None:
        keeps_left = country in LEFT_HAND
    return DrivingSide(keeps_left, keeps_left and country not in PRIORITY_TO_THE_RIGHT)


def _by_neighbours(roads: LaneletNetwork) -> bool | None:
    """Return on which side oncoming lanes are; None where there are none, or as many on either."""
    left = sum(lane.adj_left is not None and lane.adj_left_same_direction is False
               for lane in roads.lanelets)
    right = sum(lane.adj_right is not None and lane.adj_right_same_direction is False
                for lane in roads.lanelets)
    return None if left == right else right > left
