# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the package imports, setup.py asks pip for and package.xml asks rosdep for are the same."""

import ast
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
import re
import sys

from lxml import etree
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
import pytest

ROOT = Path(__file__).resolve().parents[1]
# By imported name: the pip package, and the rosdep key; None: Debian has none that would do.
THIRD_PARTY = {
    'PIL': ('pillow', 'python3-pil'),
    'aiohttp': ('aiohttp', 'python3-aiohttp'),
    'commonroad': ('commonroad-io', None),
    'commonroad_clcs': ('commonroad-clcs', None),
    'commonroad_dc': ('commonroad-drivability-checker', None),
    'commonroad_idm_planner': ('commonroad-idm-planner', None),
    'commonroad_rp': ('commonroad-reactive-planner', None),
    'evdev': ('evdev-binary', 'python3-evdev'),
    'lxml': ('lxml', 'python3-lxml'),
    'lz4': ('lz4', 'python3-lz4'),
    'markdown_it': ('markdown-it-py', None),
    'matplotlib': ('matplotlib', 'python3-matplotlib'),
    'mcap': ('mcap', None),
    'numba': ('numba', None),
    'numpy': ('numpy', 'python3-numpy'),
    'packaging': ('packaging', 'python3-packaging'),
    'plotly': ('plotly', None),
    'pyarrow': ('pyarrow', None),
    'rosbags': ('rosbags', None),
    'scipy': ('scipy', 'python3-scipy'),
    'shapely': ('shapely', 'python3-shapely'),
    'yaml': ('pyyaml', 'python3-yaml'),
    'zstandard': ('zstandard', None),
}
# What a user asks for by an extra of its own; nothing else of the package imports it.
EXTRAS = {'evaluate': {'dask', 'distributed'}, 'gym': {'gymnasium', 'pettingzoo'}}
# Dask's configuration comes with its scheduler.
OF_EXTRAS = {'dask'}
# Of ROS: each is a package of its own in package.xml; from pip they come together.
ROS = re.compile(r'\w+_msgs|std_srvs|builtin_interfaces|rcl_interfaces|rclpy|launch')
ROS_FROM_PIP = {'ros-jazzy-common-interfaces', 'ros-jazzy-rclpy'}
# For the launch file alone, which starts the launcher of run.sh.
ROS_OF_LAUNCH = {'launch', 'ros2launch'}
NOT_IN_WHEELS = {'tf2_msgs'}


def _imported() -> Iterator[str]:
    """Yield the first part of every module that the package imports, or asks the place of."""
    files = [*(ROOT / 'crgame_ros').rglob('*.py'), *(ROOT / 'launch').glob('*.py')]
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Import):
                yield from (alias.name.partition('.')[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and not node.level:
                yield (node.module or '').partition('.')[0]
            elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith('find_spec') \
                    and isinstance(node.args[0], ast.Constant):
                yield str(node.args[0].value).partition('.')[0]


@pytest.fixture(scope='module')
def imported() -> set[str]:
    """Return what is imported beyond Python and the package itself."""
    return set(_imported()) - sys.stdlib_module_names - {'crgame_ros', 'ros_wheels_bootstrapper'}


def _strings(node: ast.expr, names: dict[str, str]) -> str:
    """Evaluate a string of setup.py, which may contain a constant of that file."""
    return str(eval(compile(ast.Expression(node), 'setup.py', 'eval'), {}, names))


def _setup(keyword: str, extra: str = 'test') -> list[str]:
    """Read a list of requirements from setup.py without running it; of extras a chosen one."""
    tree = ast.parse((ROOT / 'setup.py').read_text(encoding='utf-8'))
    names = {target.id: node.value.value for node in tree.body
             if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
             for target in node.targets if isinstance(target, ast.Name)}
    call = next(node.value for node in tree.body if isinstance(node, ast.Expr)
                and isinstance(node.value, ast.Call)
                and ast.unparse(node.value.func) == 'setup')
    value = next(item.value for item in call.keywords if item.arg == keyword)
    if isinstance(value, ast.Dict):
        value = value.values[[_strings(key, names) for key in value.keys].index(extra)]
    found = value
    assert isinstance(found, ast.List)
    return [_strings(item, names) for item in found.elts]


def _manifest() -> 'etree._Element':
    return etree.parse(ROOT / 'package.xml').getroot()


def test_setup_names_what_is_imported(imported: set[str]) -> None:
    """One line for each third-party import, and none that nobody imports."""
    third_party = {name for name in imported if not ROS.fullmatch(name)}.difference(
        *EXTRAS.values())
    assert third_party == set(THIRD_PARTY)
    named = {canonicalize_name(Requirement(line).name) for line in _setup('install_requires')}
    assert named == {pip for pip, _ in THIRD_PARTY.values()} | ROS_FROM_PIP


def test_extras_name_what_they_are_for(imported: set[str]) -> None:
    """Each extra brings what its part imports, and the base imports none of it by itself."""
    for extra, names in EXTRAS.items():
        assert names <= imported
        assert {Requirement(line).name for line in _setup('extras_require', extra)} \
            == names - OF_EXTRAS
    text = (ROOT / 'package.xml').read_text(encoding='utf-8')
    found = re.search(r'Optional, from pip: (.*?)\. -->', text, re.DOTALL)
    assert found is not None
    assert {name.strip() for name in found[1].split(',')} == {
        name for names in EXTRAS.values() for name in names - OF_EXTRAS}


def test_manifest_names_what_is_imported(imported: set[str]) -> None:
    """Rosdep keys for what Debian has, every ROS package, and the rest by its pip name."""
    ros = {name for name in imported if ROS.fullmatch(name)}
    keys = {key for _, key in THIRD_PARTY.values() if key is not None}
    declared = {element.text for element in _manifest().iter('exec_depend')}
    assert declared == ros | keys | ROS_OF_LAUNCH
    text = (ROOT / 'package.xml').read_text(encoding='utf-8')
    found = re.search(r'From pip only.*?:\s(.*?)\. For the tests:\s(.*?)\. -->', text, re.DOTALL)
    assert found is not None
    listed, of_tests = ({name.strip() for name in group.split(',')} for group in found.groups())
    assert listed == {pip for pip, key in THIRD_PARTY.values() if key is None}
    extra = {canonicalize_name(Requirement(line).name) for line in _setup('extras_require')}
    assert of_tests <= extra


def test_messages_come_with_the_wheels(imported: set[str]) -> None:
    """Every ROS package that is imported comes with them, but for those that are optional."""
    missing = {name for name in imported
               if ROS.fullmatch(name) and name != 'launch' and find_spec(name) is None}
    assert missing <= NOT_IN_WHEELS


def test_both_name_the_same_people_and_place() -> None:
    """One maintainer, whose address can be nobody else's, one page, one licence."""
    manifest = _manifest()
    text = (ROOT / 'setup.py').read_text(encoding='utf-8')
    given = dict(re.findall(r"^    (\w+)='(.*)',$", text, re.MULTILINE))
    maintainer = manifest.find('maintainer')
    assert (given['maintainer'], given['maintainer_email']) == (
        maintainer.text, maintainer.get('email'))
    assert given['author'] == manifest.findtext('author')
    assert given['url'] == manifest.find("url[@type='website']").text
    assert given['license'] == manifest.findtext('license')
    # RFC 6761: nobody can register a name under .invalid, so that nobody gets our mail.
    for address in (given['maintainer_email'], given['url'].rstrip('/')):
        assert re.fullmatch(r'.*[@/][a-z-]+\.invalid', address)


def test_planners_that_pip_cannot_install_on_3_12_are_left_out_there() -> None:
    """With them `pip install` would refuse the whole package, or take versions of years ago."""
    asked = {canonicalize_name(item.name): item
             for item in map(Requirement, _setup('install_requires'))}
    conditional = {name for name, item in asked.items() if item.marker is not None}
    assert conditional == {'commonroad-idm-planner', 'commonroad-reactive-planner'}
    for name in conditional:
        marker = asked[name].marker
        assert marker.evaluate({'python_version': '3.11'})
        assert not marker.evaluate({'python_version': '3.12'})


def test_the_quality_declaration_is_linked_and_names_what_exists() -> None:
    """The README leads to it; it declares a level, and each of its links leads somewhere."""
    text = (ROOT / 'QUALITY_DECLARATION.md').read_text(encoding='utf-8')
    assert '](QUALITY_DECLARATION.md)' in (ROOT / 'README.md').read_text(encoding='utf-8')
    assert re.search(r'declares \*\*quality level [1-5]\*\*', text)
    links = re.findall(r'\]\(([^)#]+)', text)
    assert len(links) > 10
    assert not [link for link in links
                if not link.startswith('https://') and not (ROOT / link).exists()]


def test_readme_names_what_comes_from_pip_alone() -> None:
    """Its list for machines with ROS from Debian packages is the one of package.xml."""
    text = (ROOT / 'README.md').read_text(encoding='utf-8')
    found = re.search(r'only older than is needed: (.*?)\. ', text, re.DOTALL)
    assert found is not None
    assert set(re.findall(r'`([\w-]+)`', found.group(1))) == {
        pip for pip, key in THIRD_PARTY.values() if key is None}
