# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The imports of the package match the dependencies in pyproject.toml and package.xml."""

import ast
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
import re
import sys
import tomllib
from typing import Any

from lxml import etree
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
import pytest

ROOT = Path(__file__).resolve().parents[1]
# By imported name: the pip package, and the rosdep key; None: Debian has no suitable one.
THIRD_PARTY = {
    'PIL': ('pillow', 'python3-pil'),
    'aiohttp': ('aiohttp', 'python3-aiohttp'),
    'annotated_types': ('annotated-types', None),
    'commonroad': ('commonroad-io', None),
    'commonroad_clcs': ('commonroad-clcs', None),
    'commonroad_dc': ('commonroad-drivability-checker', None),
    'evdev': ('evdev-binary', 'python3-evdev'),
    'lxml': ('lxml', 'python3-lxml'),
    'lz4': ('lz4', None),
    'markdown_it': ('markdown-it-py', None),
    'matplotlib': ('matplotlib', 'python3-matplotlib'),
    'mcap': ('mcap', None),
    'numba': ('numba', None),
    'numpy': ('numpy', 'python3-numpy'),
    'packaging': ('packaging', 'python3-packaging'),
    'pyarrow': ('pyarrow', None),
    'pydantic': ('pydantic', None),
    'rosbags': ('rosbags', None),
    'scipy': ('scipy', 'python3-scipy'),
    'shapely': ('shapely', 'python3-shapely'),
    'simpleeval': ('simpleeval', None),
    'tree_sitter': ('tree-sitter', None),
    'tree_sitter_typescript': ('tree-sitter-typescript', None),
    'yaml': ('pyyaml', 'python3-yaml'),
    'zstandard': ('zstandard', None),
}
# Packages of extras, chosen by the user; no other part of the package imports them.
EXTRAS = {'evaluate': {'cryptography', 'dask', 'distributed'}, 'gym': {'gymnasium', 'pettingzoo'},
          'instruments': {'pylsl', 'serial'}, 'minari': {'minari'},
          'openscenario': {'scenariogeneration'}, 'search': {'cmaes', 'optuna', 'sklearn'},
          'statistics': {'statsmodels'}}
PIP_NAMES = {'serial': 'pyserial', 'sklearn': 'scikit-learn'}
# Of requirements-planners.txt, by imported name.
OF_PLANNERS = {'commonroad_idm_planner': 'commonroad-idm-planner',
               'commonroad_rp': 'commonroad-reactive-planner'}
# Dask's configuration comes with its scheduler.
OF_EXTRAS = {'dask'}
# Of ROS: each is a package of its own in package.xml; from pip they come together.
ROS = re.compile(r'\w+_msgs|std_srvs|\w+_interfaces|rclpy|launch')
ROS_FROM_PIP = {'ros-jazzy-common-interfaces', 'ros-jazzy-rclpy'}
# For the launch file alone, which starts the launcher of run.sh.
ROS_OF_LAUNCH = {'launch', 'ros2launch'}
NOT_IN_WHEELS = {'simulation_interfaces', 'tf2_msgs'}


def _imported() -> Iterator[str]:
    """Yield the first part of every module that the package imports or locates."""
    files = [*(ROOT / 'crgame_ros').rglob('*.py'), *(ROOT / 'launch').glob('*.py')]
    for file in files:
        for node in ast.walk(ast.parse(file.read_text(encoding='utf-8'))):
            if isinstance(node, ast.Import):
                yield from (alias.name.partition('.')[0] for alias in node.names)
            elif isinstance(node, ast.ImportFrom) and not node.level:
                yield (node.module or '').partition('.')[0]
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) \
                    and node.func.id == 'find_spec' and isinstance(node.args[0], ast.Constant):
                yield str(node.args[0].value).partition('.')[0]


@pytest.fixture(scope='module')
def imported() -> set[str]:
    """Return what is imported beyond Python and the package itself."""
    return set(_imported()) - sys.stdlib_module_names - {'crgame_ros', 'ros_wheels_bootstrapper'}


def _project() -> dict[str, Any]:
    """Read the metadata of pyproject.toml."""
    found: dict[str, Any] = tomllib.loads(
        (ROOT / 'pyproject.toml').read_text(encoding='utf-8'))['project']
    return found


def _names(requirements: list[str]) -> set[str]:
    return {canonicalize_name(Requirement(line).name) for line in requirements}


def _manifest() -> 'etree._Element':
    return etree.parse(ROOT / 'package.xml').getroot()


@pytest.mark.slow
def test_the_metadata_names_what_is_imported(imported: set[str]) -> None:
    """There is one line for each third-party import, and none without an import."""
    third_party = {name for name in imported if not ROS.fullmatch(name)}.difference(
        OF_PLANNERS, *EXTRAS.values())
    assert third_party == set(THIRD_PARTY)
    assert _names(_project()['dependencies']) == {
        pip for pip, _ in THIRD_PARTY.values()} | ROS_FROM_PIP


def test_extras_name_what_they_are_for(imported: set[str]) -> None:
    """Each extra has the imports of its part, and the base imports none of them by itself."""
    for extra, names in EXTRAS.items():
        assert names <= imported
        assert _names(_project()['optional-dependencies'][extra]) - {'crgame-ros'} == {
            PIP_NAMES.get(name, name) for name in names - OF_EXTRAS}
    text = (ROOT / 'package.xml').read_text(encoding='utf-8')
    found = re.search(r'Optional, from pip: (.*?);', text, re.DOTALL)
    assert found is not None
    assert {name.strip() for name in found[1].split(',')} == {
        PIP_NAMES.get(name, name) for names in EXTRAS.values() for name in names - OF_EXTRAS}


def test_packages_of_planners_are_pinned_apart(imported: set[str]) -> None:
    """Packages of some planners only, with their dependencies; all of them are free software."""
    assert OF_PLANNERS.keys() <= imported
    lines = [line for line in (ROOT / 'requirements-planners.txt').read_text().splitlines()
             if line and not line.startswith('#')]
    assert set(OF_PLANNERS.values()) | {'polygon3'} <= _names(lines)
    for file in ROOT.glob('requirements*.txt'):
        assert 'triangle' not in file.read_text()


def test_manifest_names_what_is_imported(imported: set[str]) -> None:
    """It has rosdep keys for Debian's packages, every ROS package, and pip names for the rest."""
    ros = {name for name in imported if ROS.fullmatch(name)}
    keys = {key for _, key in THIRD_PARTY.values() if key is not None}
    declared = {element.text for element in _manifest().iter('exec_depend')}
    assert declared == ros | keys | ROS_OF_LAUNCH
    text = (ROOT / 'package.xml').read_text(encoding='utf-8')
    found = re.search(r'From pip only.*?:\s(.*?)\. For the tests:\s(.*?)\. -->', text, re.DOTALL)
    assert found is not None
    listed, of_tests = ({name.strip() for name in group.split(',')} for group in found.groups())
    assert listed == {pip for pip, key in THIRD_PARTY.values() if key is None}
    assert of_tests <= _names(_project()['optional-dependencies']['test'])


def test_messages_come_with_the_wheels(imported: set[str]) -> None:
    """They contain every imported ROS package but the optional ones."""
    missing = {name for name in imported
               if ROS.fullmatch(name) and name != 'launch' and find_spec(name) is None}
    assert missing <= NOT_IN_WHEELS


def test_both_name_the_same_people_and_place() -> None:
    """They have one maintainer with an unusable address, one page, one licence."""
    manifest, project = _manifest(), _project()
    maintainer = manifest.find('maintainer')
    assert project['maintainers'] == [{'name': maintainer.text, 'email': maintainer.get('email')}]
    assert project['authors'] == [{'name': manifest.findtext('author')}]
    assert project['urls']['Homepage'] == manifest.find("url[@type='website']").text
    assert project['license'] == manifest.findtext('license')
    # RFC 6761: names under .invalid cannot be registered, so that no stranger gets our mail.
    for address in (maintainer.get('email'), project['urls']['Homepage'].rstrip('/')):
        assert re.fullmatch(r'.*[@/][a-z-]+\.invalid', address)


def test_the_quality_declaration_is_linked_and_names_what_exists() -> None:
    """The README leads to it; it declares a level, and each of its links leads somewhere."""
    text = (ROOT / 'QUALITY_DECLARATION.md').read_text(encoding='utf-8')
    assert '](QUALITY_DECLARATION.md)' in (ROOT / 'README.md').read_text(encoding='utf-8')
    assert re.search(r'declares \*\*quality level [1-5]\*\*', text)
    links = re.findall(r'\]\(([^)#]+)', text)
    assert len(links) > 10
    assert not [link for link in links
                if not link.startswith('https://') and not (ROOT / link).exists()]


def test_the_documents_name_what_comes_from_pip_alone() -> None:
    """The list for machines with ROS from Debian packages is the one of package.xml."""
    text = (ROOT / 'docs' / 'installation.md').read_text(encoding='utf-8')
    found = re.search(r'only older than is needed: (.*?)\. ', text, re.DOTALL)
    assert found is not None
    assert set(re.findall(r'`([\w-]+)`', found.group(1))) == {
        pip for pip, key in THIRD_PARTY.values() if key is None}
