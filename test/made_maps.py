# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Small maps in other formats, with what real files have and converters stumble over."""

# A comment before the declaration, a projection, names instead of numbers, a spiral of constant
# curvature, a limit in m/s, one of the road alone, a Swedish sign, and a crosswalk by the road.
# A straight of 100 m and an arc of 100 m with a radius of 100 m; one lane each way.
OPENDRIVE = """<!-- Some licence -->
<?xml version="1.0" standalone="yes"?>
<OpenDRIVE>
  <header revMajor="1" revMinor="7" name="made" version="1.0" date="2026-01-01">
    <geoReference><![CDATA[+proj=utm +zone=32 +ellps=WGS84 +units=m +no_defs]]></geoReference>
    <offset x="500000.0" y="5600000.0" z="0.0" hdg="0.0"/>
  </header>
  <road name="first" length="100.0" id="straight" junction="-1">
    <link><successor elementType="road" elementId="bend" contactPoint="start"/></link>
    <type s="0.0" type="town"/>
    <planView>
      <geometry s="0.0" x="0.0" y="0.0" hdg="0.0" length="100.0"><line/></geometry>
    </planView>
    <lanes>{section}</lanes>
    <objects>
      <object type="crosswalk" id="zebra" s="50.0" t="0.0" zOffset="0.0" hdg="0.0">
        <outlines><outline id="0">
          <cornerRoad s="48.0" t="-3.0" dz="0.0" height="0.0" id="0"/>
          <cornerRoad s="52.0" t="-3.0" dz="0.0" height="0.0" id="1"/>
          <cornerRoad s="52.0" t="3.0" dz="0.0" height="0.0" id="2"/>
          <cornerRoad s="48.0" t="3.0" dz="0.0" height="0.0" id="3"/>
        </outline></outlines>
      </object>
    </objects>
    <signals>
      <signal s="10.0" t="-4.0" id="a sign" name="" dynamic="no" orientation="+" country="SE"
              type="c" subtype="31" value="-1"/>
    </signals>
  </road>
  <road name="second" length="100.0" id="bend" junction="-1">
    <link><predecessor elementType="road" elementId="straight" contactPoint="end"/></link>
    <type s="0.0" type="rural"><speed max="70" unit="km/h"/></type>
    <planView>
      <geometry s="0.0" x="100.0" y="0.0" hdg="0.0" length="100.0">
        <spiral curvStart="0.01" curvEnd="0.01"/>
      </geometry>
    </planView>
    <lanes>{plain}</lanes>
  </road>
</OpenDRIVE>
"""
_LANE = """<lane id="{number}" type="driving" level="false">
  <link><{link} id="{number}"/></link>
  <width sOffset="0.0" a="3.5" b="0.0" c="0.0" d="0.0"/>
  <roadMark sOffset="0.0" type="solid" weight="standard" color="standard" width="0.12"/>{speed}
</lane>"""
_SECTION = """<laneSection s="0.0">
  <left>{left}</left>
  <center><lane id="0" type="none" level="false">
    <roadMark sOffset="0.0" type="broken" weight="standard" color="standard" width="0.12"/>
  </lane></center>
  <right>{right}</right>
</laneSection>"""


def opendrive() -> str:
    """Return the OpenDRIVE map: limits of 15 m/s, then of 70 km/h."""
    section, plain = (_SECTION.format(**{
        side: _LANE.format(number=number, link=link, speed=speed)
        for side, number in (('left', 1), ('right', -1))})
        for link, speed in (('successor', '<speed sOffset="0.0" max="15.0"/>'),
                            ('predecessor', '')))
    return OPENDRIVE.format(section=section, plain=plain)


def lanelet2(local: bool) -> str:
    """
    Return a Lanelet2 map: a lane of two lanelets, northwards, and one the other way beside it.

    Each lanelet is 0.002 degrees of latitude long at 49 degrees north, and 0.00005 degrees of
    longitude wide. The first has a limit of 50 km/h in Autoware's words, the second in Lanelet2's.

    :param local: with `local_x` and `local_y`, and empty latitudes, as of Autoware: 200 m and 4 m.
    """
    nodes, ways = [], []
    for column in range(3):
        for row in range(3):
            number = 1 + 3 * column + row
            place = f'lat="{49 + 0.002 * row:.6f}" lon="{8 + 0.00005 * column:.6f}"'
            tags = ''
            if local:
                place = 'lat="" lon=""'
                tags = f'<tag k="local_x" v="{4.0 * column}"/><tag k="local_y" v="{200.0 * row}"/>'
            nodes.append(f'<node id="{number}" {place}>{tags}</node>')
        for row in range(2):
            first = 1 + 3 * column + row
            ways.append(f'<way id="{20 + 2 * column + row}"><nd ref="{first}"/>'
                        f'<nd ref="{first + 1}"/><tag k="type" v="line_thin"/></way>')
    tags = ''.join(f'<tag k="{key}" v="{value}"/>' for key, value in (
        ('type', 'lanelet'), ('subtype', 'road'), ('location', 'urban'), ('one_way', 'yes')))
    relations = [
        (40, 22, 24, '<tag k="speed_limit" v="50"/>'),
        (41, 23, 25, '<member type="relation" role="regulatory_element" ref="50"/>'),
        (42, 23, 21, ''), (43, 22, 20, '')]
    lanelets = [f'<relation id="{number}"><member type="way" role="left" ref="{left}"/>'
                f'<member type="way" role="right" ref="{right}"/>{more}{tags}</relation>'
                for number, left, right, more in relations]
    limits = [f'<relation id="{number}"><tag k="type" v="regulatory_element"/>'
              f'<tag k="subtype" v="speed_limit"/>{more}</relation>'
              for number, more in ((50, '<tag k="sign_type" v="de274-30"/>'), (51, ''))]
    return '<osm>' + ''.join([*nodes, *ways, *lanelets, *limits]) + '</osm>'


def openstreetmap() -> str:
    """Return an extract: a crossing with lights of two roads, 0.004 and 0.006 degrees long."""
    places = {1: (52.0, 13.0), 2: (52.002, 13.0), 3: (51.998, 13.0), 4: (52.0, 13.003),
              5: (52.0, 12.997)}
    nodes = [f'<node id="{number}" lat="{latitude}" lon="{longitude}" version="1">'
             + '<tag k="highway" v="traffic_signals"/>' * (number == 1) + '</node>'
             for number, (latitude, longitude) in places.items()]
    ways = [f'<way id="{number}" version="1">'
            + ''.join(f'<nd ref="{ref}"/>' for ref in refs)
            + '<tag k="highway" v="residential"/><tag k="maxspeed" v="30"/></way>'
            for number, refs in ((10, (2, 1, 3)), (11, (4, 1, 5)))]
    return '<osm version="0.6">' + ''.join(nodes + ways) + '</osm>'
