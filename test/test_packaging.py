# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The installed files and their places, the pins, and scripts/env.sh."""

from collections.abc import Iterator
from configparser import ConfigParser
import hashlib
from importlib import import_module
import os
from pathlib import Path
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from zipfile import ZipFile

from crgame_ros import __version__
from crgame_ros.cli import _build_parser
from lxml import etree
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
import pytest

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / 'scripts'))

from architecture import imported_names  # noqa: E402, I100

NODES = ('sim_node', 'driver_node', 'planner_node', 'drivability_node', 'criticality_node',
         'timesync_node', 'recorder_node', 'marker_node', 'cockpit_node',
         'perception_node', 'traffic_node', 'map_node', 'instruments_node')
DATA = ('launch', 'config', 'examples', 'scenarios', 'msg_defs', 'page')
PINS = ('requirements.txt', 'requirements-planners.txt')
# Without uv, wherever this machine has it.
WITHOUT_UV = os.pathsep.join(folder for folder in os.environ['PATH'].split(os.pathsep)
                             if not (Path(folder) / 'uv').exists())
# Modules of ROS packages whose name is no ROS package's.
MESSAGE_PACKAGE = re.compile(r'\w+_msgs|std_srvs|builtin_interfaces|rcl_interfaces|rclpy')


def _copy(target: Path, *names: str) -> Path:
    """Copy a part of the source tree."""
    for name in names:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, target / name, dirs_exist_ok=True,
                            ignore=shutil.ignore_patterns('__pycache__'))
        else:
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / name, target / name)
    return target


def _pip(*arguments: str) -> None:
    """Run pip without a package index."""
    done = subprocess.run([sys.executable, '-m', 'pip', '--disable-pip-version-check',
                           *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.fixture(scope='module')
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Copy the sources of a package."""
    copied = _copy(tmp_path_factory.mktemp('source'), 'crgame_ros', 'resource', 'config',
                   'msg_defs', 'page', 'package.xml', 'setup.py', 'setup.cfg', 'pyproject.toml',
                   'requirements.txt', 'requirements-planners.txt', 'LICENSE',
                   *(name for name in ('examples', 'launch', 'scenarios')
                     if (ROOT / name).is_dir()))
    # As in a tree where the page has been checked.
    foreign = copied / 'test' / 'page' / 'node_modules' / 'somebody'
    foreign.mkdir(parents=True)
    (foreign / 'index.js').touch()
    return copied


@pytest.fixture(scope='module')
def wheel(source: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build a wheel from a copy of the source tree."""
    target = tmp_path_factory.mktemp('wheel')
    _pip('wheel', '--no-deps', '--no-build-isolation', '--wheel-dir', str(target), str(source))
    return next(target.glob('*.whl'))


@pytest.mark.matrix('options1')
@pytest.mark.slow
@pytest.mark.parametrize('options', [[], ['--symlink-install']])
def test_colcon_makes_executables(source: Path, options: list[str], tmp_path: Path) -> None:
    """It makes them also when it runs setup.py without pyproject.toml, as for links."""
    done = subprocess.run(
        [sys.executable, '-m', 'colcon', '--log-base', str(tmp_path / 'log'), 'build',
         '--base-paths', str(source), '--build-base', str(tmp_path / 'build'),
         '--install-base', str(tmp_path / 'install'), *options], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    executables = tmp_path / 'install' / 'crgame_ros' / 'lib' / 'crgame_ros'
    for name in (*NODES, 'crgame'):
        assert os.access(executables / name, os.X_OK)


@pytest.fixture(scope='module')
def prefix(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel into a prefix of its own."""
    target = tmp_path_factory.mktemp('prefix')
    _pip('install', '--no-deps', '--ignore-installed', '--no-warn-script-location', '--no-compile',
         '--prefix', str(target), str(wheel))
    return target


def _pins(name: str) -> dict[str, str]:
    """Read a file of pins."""
    lines = (ROOT / name).read_text(encoding='utf-8').splitlines()
    return {canonicalize_name(item.name): next(iter(item.specifier)).version
            for item in (Requirement(line.removesuffix('\\')) for line in lines
                         if '==' in line and not line.startswith('#'))}


@pytest.mark.slow
def test_data_files_are_installed_where_ros_looks(prefix: Path) -> None:
    """The marker, the manifest and every data file are under share/, equal to the source's."""
    share = prefix / 'share' / 'crgame_ros'
    index = prefix / 'share' / 'ament_index' / 'resource_index' / 'packages' / 'crgame_ros'
    assert index.is_file()
    assert (share / 'package.xml').read_bytes() == (ROOT / 'package.xml').read_bytes()
    expected = {file.relative_to(ROOT) for name in DATA for file in (ROOT / name).rglob('*')
                if file.is_file() and '__pycache__' not in file.parts}
    installed = {file.relative_to(share) for file in share.rglob('*')
                 if file.is_file() and '__pycache__' not in file.parts}
    assert installed == expected | {Path('package.xml'), *map(Path, PINS)}
    assert all((share / file).read_bytes() == (ROOT / file).read_bytes() for file in expected)


def test_installed_package_finds_its_data(prefix: Path) -> None:
    """The installed package, run elsewhere, takes the installed share directory."""
    site = next(prefix.glob('lib/python3*/site-packages'))
    assert (site / 'crgame_ros' / 'py.typed').is_file()
    done = subprocess.run(
        [sys.executable, '-c', 'import crgame_ros.paths as p; print(p.share_directory())'],
        cwd=prefix, env=dict(os.environ, PYTHONPATH=str(site)), capture_output=True, text=True)
    assert Path(done.stdout.strip()) == prefix / 'share' / 'crgame_ros'


def test_ros2_run_finds_executables(prefix: Path) -> None:
    """The file in lib/crgame_ros that `ros2 run` starts passes everything to the script in bin."""
    for name in (*NODES, 'crgame'):
        assert os.access(prefix / 'bin' / name, os.X_OK)
        assert os.access(prefix / 'lib' / 'crgame_ros' / name, os.X_OK)
    script = prefix / 'bin' / 'sim_node'
    kept = script.read_text()
    script.write_text('#!/bin/sh\nprintf "%s|" "$@"\nexit 3\n')
    try:
        done = subprocess.run([prefix / 'lib' / 'crgame_ros' / 'sim_node', 'a b', '--ros-args'],
                              capture_output=True, text=True)
    finally:
        script.write_text(kept)
    assert (done.returncode, done.stdout) == (3, 'a b|--ros-args|')


@pytest.mark.slow
def test_only_traffic_waits_for_the_compiler() -> None:
    """Other nodes, and a run without agents, don't load numba: 0.4 s and 60 MB each."""
    others = [name for name in NODES if name != 'traffic_node']
    script = f"""
import sys
from importlib import import_module
from crgame_ros.paths import scenarios_directory
from crgame_ros.game.game import load_game
from crgame_ros.simulation.offline import run_offline
from crgame_ros.simulation.setup import build_setup
for name in {others}:
    import_module('crgame_ros.nodes.' + name)
game = load_game(scenarios_directory() / 'occluded_pedestrian.yaml')
assert game.objects and game.traffic is None
run_offline(build_setup(game), duration_s=1.0)
print('numba' in sys.modules)
"""
    done = subprocess.run([sys.executable, '-c', script], cwd=ROOT, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, 'False\n'), done.stderr


def test_the_page_is_installed_without_what_checks_it(wheel: Path) -> None:
    """Users get the files of the page as they are; Node and its packages are for tests."""
    with ZipFile(wheel) as archive:
        names = archive.namelist()
    assert {Path(name).suffix for name in names if '/share/crgame_ros/page/' in name} == {
        '.html', '.css', '.ts'}
    assert not [name for name in names if 'node_modules' in name or name.startswith('test')]


def test_every_entry_point_resolves(wheel: Path) -> None:
    """Each console script names something that exists."""
    with ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith('entry_points.txt'))
        parser = ConfigParser(delimiters=('=',))
        parser.read_string(archive.read(name).decode())
    assert parser.sections() == ['console_scripts']
    assert set(parser['console_scripts']) == {*NODES, 'crgame'}
    for target in parser['console_scripts'].values():
        module, _, attribute = target.partition(':')
        assert callable(getattr(import_module(module), attribute))


@pytest.mark.parametrize(('name', 'extras'), [
    ('requirements.txt', []), ('requirements-dev.txt', ['test', 'docs', 'gym', 'evaluate'])])
def test_requirements_are_pinned_and_serve_the_installation(name: str, extras: list[str]) -> None:
    """Each has its hashes and no address; they satisfy the requirements of pyproject.toml."""
    text = (ROOT / name).read_text(encoding='utf-8')
    assert '://' not in text
    for package in re.split(r'\n(?! )', text.strip()):
        assert re.match(r'[\w.-]+==[\w.]+ \\\n    --hash=sha256:', package), package
    pins = _pins(name)
    project = tomllib.loads((ROOT / 'pyproject.toml').read_text(encoding='utf-8'))['project']
    optional = project['optional-dependencies']
    asked = [Requirement(line) for line in
             (*project['dependencies'], *(line for extra in extras for line in optional[extra]))]
    assert len(asked) > 20
    wrong = [str(item) for item in asked if item.name != 'crgame_ros'
             and not item.specifier.contains(pins[canonicalize_name(item.name)])]
    assert not wrong


def test_what_developers_have_is_what_users_have() -> None:
    """Tests run on the versions that users get."""
    pins, of_all = _pins('requirements-dev.txt'), _pins('requirements.txt')
    assert {name: pins.get(name) for name in of_all} == of_all


@pytest.mark.slow
def test_manifest_names_what_the_package_imports() -> None:
    """package.xml has the version, the build type, and every ROS package that is imported."""
    manifest = etree.parse(ROOT / 'package.xml').getroot()
    assert manifest.get('format') == '3'
    assert manifest.findtext('name') == 'crgame_ros'
    assert manifest.findtext('version') == __version__
    assert manifest.findtext('license') == 'Apache-2.0'
    assert manifest.findtext('export/build_type') == 'ament_python'
    imported = set()
    for file in (ROOT / 'crgame_ros').rglob('*.py'):
        imported |= {name.partition('.')[0] for name, _ in imported_names(file)}
    ros = {name for name in imported if MESSAGE_PACKAGE.fullmatch(name)}
    declared = {element.text for element in manifest.iter('exec_depend')}
    assert ros <= declared, ros - declared


def _source(tree: Path, then: str = '', **variables: str) -> subprocess.CompletedProcess[str]:
    """Source scripts/env.sh of a tree in a clean, strict bash and run a command after it."""
    environment = {'PATH': os.environ['PATH'], 'HOME': os.environ.get('HOME', '/'), **variables}
    return subprocess.run(
        ['bash', '-c', f'set -euo pipefail; source "{tree}/scripts/env.sh"; {then}'],
        env=environment, capture_output=True, text=True)


def _stamped(tree: Path) -> Path:
    """Make a tree with an .venv that is complete as far as scripts/env.sh can tell."""
    _copy(tree, 'scripts/env.sh', 'scripts/make_venv.sh', *PINS, 'config/fastdds_loopback.xml')
    libraries = tree / '.venv' / 'lib' / 'python3.11' / 'site-packages' / 'ros_rcl.libs'
    libraries.mkdir(parents=True)
    (tree / '.venv' / 'bin').mkdir()
    (tree / '.venv' / 'bin' / 'python').symlink_to(sys.executable)
    digest = hashlib.sha256(b''.join((tree / name).read_bytes() for name in PINS)).hexdigest()
    (tree / '.venv' / 'stamp').write_text(f'{digest}  -\n')
    return tree.resolve()


def test_env_sets_the_environment_once(tmp_path: Path) -> None:
    """A second call changes nothing; the user's own entries on the paths stay behind ours."""
    tree = _stamped(tmp_path / 'a tree')
    show = 'env | grep -vE "^(_|SHLVL|PWD|OLDPWD)=" | sort'
    once = _source(tree, show, AMENT_PREFIX_PATH='/overlay')
    twice = _source(tree, f'source "{tree}/scripts/env.sh"; {show}', AMENT_PREFIX_PATH='/overlay')
    assert once.returncode == 0, once.stderr
    assert once.stdout == twice.stdout
    values = dict(line.split('=', 1) for line in once.stdout.splitlines())
    profile = str(tree / 'config' / 'fastdds_loopback.xml')
    assert values['AMENT_PREFIX_PATH'] == f'{tree}/.venv:/overlay'
    assert set(values['LD_LIBRARY_PATH'].split(':')) == {
        f'{tree}/.venv/lib', f'{tree}/.venv/lib/python3.11/site-packages/ros_rcl.libs'}
    assert values['FASTRTPS_DEFAULT_PROFILES_FILE'] == profile
    assert values['FASTDDS_DEFAULT_PROFILES_FILE'] == profile
    assert values['ROS_AUTOMATIC_DISCOVERY_RANGE'] == 'LOCALHOST'
    assert values['RMW_IMPLEMENTATION'] == 'rmw_fastrtps_cpp'
    # Named for the tools of ROS, which makes no installed Jazzy of the wheels.
    assert values['ROS_DISTRO'] == 'jazzy'
    assert values['PYTHONPATH'] == str(tree)
    assert values['MPLBACKEND'] == 'Agg'
    assert values['OMP_NUM_THREADS'] == values['OPENBLAS_NUM_THREADS'] == '1'
    assert values['CRGAME_PYTHON'] == f'{tree}/.venv/bin/python'


def test_env_opens_the_network_on_request(tmp_path: Path) -> None:
    """CRGAME_OPEN_NETWORK=1 also removes the settings of an earlier call."""
    tree = _stamped(tmp_path)
    done = _source(tree, f'export CRGAME_OPEN_NETWORK=1; source "{tree}/scripts/env.sh"; env')
    assert done.returncode == 0, done.stderr
    assert 'PROFILES_FILE' not in done.stdout
    assert 'DISCOVERY_RANGE' not in done.stdout


def test_env_keeps_another_ros_apart(tmp_path: Path) -> None:
    """With wheels, the paths of another ROS are dropped and the user's own entries kept."""
    tree = _stamped(tmp_path / 'tree')
    other = tmp_path / 'other'
    for name in ('site/rclpy', 'share/rclpy', 'lib'):
        (other / name).mkdir(parents=True)
    (other / 'lib' / 'librcl.so').touch()
    done = _source(tree, 'echo "$PYTHONPATH $AMENT_PREFIX_PATH $LD_LIBRARY_PATH"',
                   PYTHONPATH=f'{other}/site:/mine', AMENT_PREFIX_PATH=str(other),
                   LD_LIBRARY_PATH=f'{other}/lib:/lib/mine')
    assert done.returncode == 0, done.stderr
    assert str(other) not in done.stdout
    assert ':/mine ' in done.stdout
    assert ':/lib/mine' in done.stdout


def test_env_takes_an_installed_jazzy_and_no_wheels_of_another_checkout(tmp_path: Path) -> None:
    trees = [_stamped(tmp_path / name) for name in ('one', 'two')]
    jazzy = tmp_path / 'jazzy'
    package = Path('lib', f'python{sys.version_info.major}.{sys.version_info.minor}',
                   'site-packages', 'rclpy')
    for tree in (*(tree / '.venv' for tree in trees), jazzy):
        (tree / package).mkdir(parents=True, exist_ok=True)
        (tree / 'share' / 'rclpy').mkdir(parents=True)
    for tree in trees:
        (tree / '.venv' / 'pyvenv.cfg').touch()
    (trees[1] / '.venv' / 'bin' / package.parts[1]).symlink_to(sys.executable)
    (trees[1] / '.venv-jazzy').symlink_to('.venv')
    again = f'source "{trees[1]}/scripts/env.sh"; echo "$CRGAME_PYTHON $AMENT_PREFIX_PATH"'
    # PYTHON has the shell look for a ROS for that Python again.
    for python in ({}, {'PYTHON': sys.executable}):
        done = _source(trees[0], again, **python)
        assert done.stdout == f'{trees[1]}/.venv/bin/python {trees[1]}/.venv\n', done.stderr
        done = _source(trees[1], again, ROS_DISTRO='jazzy', AMENT_PREFIX_PATH=str(jazzy), **python)
        assert done.stdout == f'{trees[1]}/.venv-jazzy/bin/python {jazzy}\n', done.stderr
        assert not done.stderr


def test_env_refuses_other_pythons(tmp_path: Path) -> None:
    """Python 3.10 is refused in one line with exit code 2, and nothing is made."""
    tree = _copy(tmp_path / 'tree', 'scripts/env.sh', 'scripts/make_venv.sh', *PINS)
    old = tmp_path / 'python3.10'
    old.write_text('#!/bin/sh\necho "3.10 $0"\n')
    old.chmod(0o755)
    done = _source(tree, PYTHON=str(old))
    assert done.returncode == 2
    assert done.stderr.count('\n') == 1
    assert 'needs Python 3.11 or 3.12' in done.stderr
    assert f'({old} is 3.10)' in done.stderr
    assert not (tree / '.venv').exists()


def test_env_makes_another_one_beside_an_environment_of_another_python(tmp_path: Path) -> None:
    """The first, which may be in use, is unchanged, also if the second one fails."""
    tree = _stamped(tmp_path / 'tree')
    other = tmp_path / 'python3.12'
    # A Python that exists but cannot make a venv.
    other.write_text('#!/bin/sh\ncase "$*" in *_base_executable*) echo "3.12 $0";; '
                     '*"-m venv"*) exit 1;; esac\n')
    other.chmod(0o755)
    before = (tree / '.venv' / 'stamp').read_text()
    done = _source(tree, PYTHON=str(other), PATH=WITHOUT_UV)
    assert done.returncode == 1
    assert 'installing packages into .venv-3.12' in done.stderr
    assert 'cannot make environments: apt install python3-venv' in done.stderr.splitlines()[-1]
    assert (tree / '.venv' / 'stamp').read_text() == before
    assert (tree / '.venv' / 'bin' / 'python').exists()
    # Complete, it is used if that Python is asked for; the first is used if none is.
    (tree / '.venv-3.12' / 'bin').mkdir()
    (tree / '.venv-3.12' / 'bin' / 'python').symlink_to(sys.executable)
    (tree / '.venv-3.12' / 'stamp').write_text(before)
    for variables, name in (({'PYTHON': str(other)}, '.venv-3.12'), ({}, '.venv')):
        done = _source(tree, 'echo "$CRGAME_PYTHON"', **variables)
        assert done.stdout == f'{tree}/{name}/bin/python\n', done.stderr


@pytest.mark.exhaustive
def test_env_says_that_the_index_is_out_of_reach(tmp_path: Path) -> None:
    """Without a package index it ends with one clear line, and the next call goes on."""
    tree = _copy(tmp_path, 'scripts/env.sh', 'scripts/make_venv.sh', *PINS)
    done = _source(tree, PYTHON=sys.executable, PIP_CONFIG_FILE=os.devnull, PATH=WITHOUT_UV,
                   PIP_INDEX_URL='http://127.0.0.1:9/simple', PIP_NO_CACHE_DIR='1')
    assert done.returncode == 1
    assert 'uv, which installs packages, cannot be installed: check the network' \
        in done.stderr.splitlines()[-1]
    assert not (tree / '.venv' / 'stamp').exists()
    assert (tree / '.venv' / 'COLCON_IGNORE').exists()


def test_a_checkout_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    tree = _copy(tmp_path, 'scripts/env.sh', 'scripts/make_venv.sh', *PINS)
    # Not even root makes a folder where a file is.
    (tree / '.venv').touch()
    done = _source(tree, PYTHON=sys.executable)
    assert done.returncode == 1 and done.stderr.count('\n') == 1
    assert f'cannot write to {tree.resolve()}/.venv: copy the checkout' in done.stderr


@pytest.mark.parametrize('step', ['venv', 'polygon3'])
def test_ctrl_c_while_packages_are_installed_is_one_line(tmp_path: Path, step: str) -> None:
    """The whole group gets the signal, as from a terminal; nothing goes on or keeps the lock."""
    tree = _copy(tmp_path, 'scripts/env.sh', 'scripts/make_venv.sh', *PINS)
    uv = tmp_path / 'programs' / 'uv'
    uv.parent.mkdir()
    begun = tmp_path / 'begun'
    uv.write_text(f'#!/bin/sh\ncase "$*" in *{step}*) touch {begun}; exec sleep 600;; esac\n')
    uv.chmod(0o755)
    # Loads libraries of pages beside the compiler.
    python, loads = tree / '.venv' / 'bin' / 'python', tmp_path / 'pid'
    python.parent.mkdir(parents=True)
    (tree / '.venv' / 'lib' / 'python3' / 'site-packages').mkdir(parents=True)
    python.write_text(f'#!/bin/sh\necho $$ >{loads}.new; mv {loads}.new {loads}; exec sleep 600\n')
    python.chmod(0o755)
    with subprocess.Popen(
            [tree / 'scripts' / 'make_venv.sh', tree / '.venv', sys.executable, 'wheels', 'none'],
            env=os.environ | {'PATH': f'{uv.parent}:{os.environ["PATH"]}', 'CRGAME_DEVELOP': ''},
            text=True, stderr=subprocess.PIPE, start_new_session=True) as process:
        while not begun.exists() or step == 'polygon3' and not loads.exists():
            assert process.poll() is None
            time.sleep(0.01)
        os.killpg(process.pid, signal.SIGINT)
        assert process.stderr is not None
        assert process.stderr.read().endswith(
            'crgame: stopped; the next start goes on from here\n')
    assert process.returncode == 130
    lock = tree / '.venv' / 'making.lock'
    assert subprocess.run(['flock', '--nonblock', lock, 'true']).returncode == 0
    if step == 'polygon3':
        left = Path('/proc', loads.read_text().strip(), 'cmdline')
        until = time.monotonic() + 10.0
        while left.exists() and left.read_bytes() and time.monotonic() < until:
            time.sleep(0.01)
        assert not left.exists() or not left.read_bytes()


@pytest.mark.parametrize('ros', ['wheels', 'jazzy'])
def test_an_installed_jazzy_takes_the_place_of_its_wheels_alone(tmp_path: Path, ros: str) -> None:
    """All other packages are installed, each line with its version and hashes."""
    tree = _copy(tmp_path, 'scripts/make_venv.sh', *PINS)
    uv = tmp_path / 'programs' / 'uv'
    uv.parent.mkdir()
    # Ends where the packages would be installed.
    uv.write_text('#!/bin/sh\ncase "$*" in pip*) exit 1;; esac\n')
    uv.chmod(0o755)
    done = subprocess.run(
        [tree / 'scripts' / 'make_venv.sh', tree / '.venv', sys.executable, ros, 'none'],
        env=os.environ | {'PATH': f'{uv.parent}:{os.environ["PATH"]}', 'CRGAME_DEVELOP': ''},
        capture_output=True, text=True)
    assert done.returncode == 1 and 'the packages are not installed' in done.stderr
    wanted = re.findall(r'^\w\S+==\S+', (ROOT / 'requirements.txt').read_text(), re.MULTILINE)
    if ros == 'jazzy':
        wanted = [pin for pin in wanted if not pin.startswith('ros-')]
    lines = (tree / '.venv' / 'requirements.txt').read_text().splitlines()
    lines = [line for line in lines if line and not line.startswith('#')]
    assert [line.split()[0] for line in lines] == wanted
    assert all(re.fullmatch(r'[^#]+==\S+( ;[^#]+?)?(\s+--hash=sha256:[0-9a-f]{64})+', line)
               for line in lines)


def test_help_needs_no_environment(tmp_path: Path) -> None:
    """It needs no packages and no writable folder, also through a link."""
    tree = _copy(tmp_path / 'tree', 'scripts/env.sh', 'scripts/make_venv.sh', *PINS, 'run.sh',
                 'test.sh', 'crgame')
    (tree / 'crgame_ros').symlink_to(ROOT / 'crgame_ros')
    (tree / 'msg_defs').symlink_to(ROOT / 'msg_defs')
    environment = {'PATH': os.environ['PATH'], 'HOME': os.environ.get('HOME', '/')}
    for name, said in (('run.sh', 'usage: run.sh'), ('crgame', 'usage: crgame'),
                       ('test.sh', './test.sh --quick')):
        link = tmp_path / f'link-{name}'
        link.symlink_to(tree / name)
        done = subprocess.run([link, '--help'], env=environment, capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, '') and said in done.stdout, name
    assert not (tree / '.venv').exists()


def _examples() -> Iterator[tuple[Path, str]]:
    """Yield every example of the README and the docs that calls crgame, without its comment."""
    for page in (ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', *(ROOT / 'docs').glob('*.md')):
        for block in re.findall(r'^```bash\n(.*?)^```', page.read_text(encoding='utf-8'),
                                re.MULTILINE | re.DOTALL):
            for line in block.splitlines():
                if re.match(r'(\S*/)?crgame\s', line):
                    yield page, line.partition(' #')[0]


def test_examples_of_crgame_are_true() -> None:
    """Each calls the command of a clone, from the reader's folder, with valid arguments."""
    examples = list(_examples())
    assert len(examples) >= 7
    for page, line in examples:
        program, *words = shlex.split(line.replace('<', '').replace('>', ''))
        assert program == './crgame', f'{page}: {line}'
        assert callable(_build_parser(words[0]).parse_args(words).command), f'{page}: {line}'


@pytest.mark.slow
def test_crgame_runs_from_a_clone(tmp_path: Path) -> None:
    """From any directory, through a link, and by its name once env.sh has been sourced."""
    tree = _stamped(tmp_path / 'a tree')
    _copy(tree, 'crgame')
    (tree / '.venv' / 'bin' / 'crgame').symlink_to('../../crgame')
    (tree / 'crgame_ros').symlink_to(ROOT / 'crgame_ros')
    (tmp_path / 'link').symlink_to(tree / 'crgame')
    # This interpreter, with its packages.
    python = tree / '.venv' / 'bin' / 'python'
    python.unlink()
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    code = f'cd "{tmp_path}"; '
    for command in (f'"{tree}/crgame"', './link', 'crgame'):
        done = _source(tree, f'{code}{command} --help && {command} info no_such_bag')
        assert re.search('convert +turn a recording into a CommonRoad', done.stdout), done
        assert (done.returncode, done.stderr) == (
            2, 'error: no_such_bag: no such file or folder; give a recording\n'), command


def test_shell_scripts_parse() -> None:
    """Every shell script of the project parses."""
    scripts = [ROOT / name for name in ('run.sh', 'crgame', 'test.sh', '.ci/run')
               if (ROOT / name).exists()]
    for script in (*scripts, *(ROOT / 'scripts').glob('*.sh')):
        done = subprocess.run(['bash', '-n', script], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
