# shellcheck shell=bash
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# The environment of every command: `source scripts/env.sh` from bash, as run.sh and test.sh do.
#
# The first call makes .venv from requirements.txt; later calls only set variables. Where a ROS 2
# Jazzy installation is sourced it is used; elsewhere ROS comes into .venv as wheels. A terminal with
# another Python or ROS gets an environment of its own beside it, .venv-<python>-<ros>; one that a
# process uses is never changed.
#
#   PYTHON=python3.12      the interpreter to make .venv with (3.11 or 3.12). Without it an existing
#                          .venv stays as it is and a new one takes the first of python3,
#                          python3.12 and python3.11 that fits.
#   CRGAME_OPEN_NETWORK=1  let ROS traffic leave this machine.
#
# Sets CRGAME_PYTHON, the interpreter to run. Returns 2 where there is no usable Python and 1 where
# the packages cannot be installed.

_crgame_say() {
    printf 'crgame: %s\n' "$*" >&2
}

# Set python, version and ros (the prefix of the sourced Jazzy, or "wheels").
_crgame_choose() {
    local candidate probed seen='' candidates=(python3 python3.12 python3.11)
    [[ -z ${PYTHON:-} ]] || candidates=("$PYTHON")
    python=''
    for candidate in "${candidates[@]}"; do
        # The real interpreter: a venv made from another venv would depend on both.
        probed=$("$candidate" -c 'import sys
print(getattr(sys, "_base_executable", sys.executable), "%d.%d" % sys.version_info[:2])' \
            2>/dev/null) || continue
        version=${probed##* }
        seen+=" ($candidate is $version)"
        case $version in
            3.11 | 3.12) python=${probed% *} && break ;;
        esac
    done
    if [[ -z $python ]]; then
        _crgame_say "needs Python 3.11 or 3.12, found none${seen:- at ${candidates[*]}};" \
            'install one or name it: PYTHON=/path/to/python3.12'
        return 2
    fi
    if ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
        _crgame_say "$python has no venv and ensurepip: apt install python3-venv" \
            "(or python$version-venv)"
        return 2
    fi
    ros=wheels
    [[ ${ROS_DISTRO:-} == jazzy ]] || return 0
    if ! ros=$("$python" -c 'import rclpy
print(rclpy.__file__.partition("/lib/python")[0])' 2>/dev/null); then
        ros=wheels
        _crgame_say "the sourced ROS 2 Jazzy has no rclpy for $python (Python $version):" \
            'taking ROS from wheels'
    fi
}

# Whether .venv is complete and serves this call; sets python, version and ros from its stamp.
_crgame_ready() {
    local stamp
    [[ -r $venv/stamp && -x $venv/bin/python ]] || return 1
    mapfile -t stamp <"$venv/stamp"
    [[ ${#stamp[@]} == 7 && ${stamp[0]} == "$wanted" && ${stamp[1]} == "$root" ]] || return 1
    python=${stamp[2]} version=${stamp[3]} ros=${stamp[4]}
    [[ ${stamp[5]} == "${PYTHON:-${stamp[5]}}" && ${stamp[6]} == "${ROS_DISTRO:-none}" ]]
}

# Whether .venv is what _crgame_choose chose, though asked for in other words.
_crgame_same() {
    local stamp
    [[ -r $venv/stamp && -x $venv/bin/python ]] || return 1
    mapfile -t stamp <"$venv/stamp"
    [[ ${stamp[0]} == "$wanted" && ${stamp[1]} == "$root" && ${stamp[3]} == "$version" &&
        ${stamp[4]} == "$ros" ]]
}

_crgame_stamp() {
    printf '%s\n' "$wanted" "$root" "$python" "$version" "$ros" "${PYTHON:-default}" \
        "${ROS_DISTRO:-none}" >"$venv/stamp.new"
    mv "$venv/stamp.new" "$venv/stamp"
}

_crgame_progress() {
    local fetched installed
    fetched=$(grep -cE '^(Collecting|Processing) ' "$venv/install.log" 2>/dev/null) || true
    installed=$(find "$venv" -maxdepth 4 -name '*.dist-info' ! -name 'pip-*' 2>/dev/null | wc -l)
    # shellcheck disable=SC2059
    printf "$1" "$(((fetched + installed) * 50 / total))" "$fetched" "$installed" "$total" >&2
}

# Wait for a process and never be silent for long: one line rewritten on a terminal, else a line
# every second.
_crgame_watch() {
    local line='crgame: making .venv: %3d %% (%d fetched, %d installed of %d packages)' told=-1
    while kill -0 "$1" 2>/dev/null; do
        if [[ -t 2 ]]; then
            _crgame_progress "\\r$line"
        elif ((SECONDS != told)); then
            told=$SECONDS
            _crgame_progress "$line\\n"
        fi
        sleep 0.25
    done
    [[ ! -t 2 ]] || printf '\n' >&2
    wait "$1"
}

# Whether an environment is that of this Python and ROS: complete, or in the making.
_crgame_fits() {
    local key
    [[ -r $1/key ]] || return 1
    read -r key <"$1/key"
    [[ $key == "$version $ros" ]]
}

# Whether a process has loaded libraries of an environment.
_crgame_in_use() {
    grep -qsF " $1/" /proc/[0-9]*/maps
}

# Set venv to where the environment of this Python and ROS is, or is to be made.
_crgame_place() {
    local tag=${ros##*/}
    venv=$root/.venv
    # One that was made before there were others has no key.
    if [[ -r $venv/stamp && ! -e $venv/key ]]; then
        sed -n '4,5p' "$venv/stamp" | paste -sd ' ' >"$venv/key" 2>/dev/null || true
    fi
    if [[ -e $venv/key ]] && ! _crgame_fits "$venv"; then
        venv=$root/.venv-$version-$tag
    fi
    if [[ -r $venv/stamp ]] && ! _crgame_same && _crgame_in_use "$venv"; then
        venv=$root/.venv-$version-$tag-${wanted:0:8}
    fi
}

# Every step that fills .venv; its output is the log.
_crgame_fill() {
    local pip=("$venv/bin/python" -m pip --disable-pip-version-check --no-input install --no-deps
        --ignore-requires-python --no-build-isolation --progress-bar off
        --no-warn-script-location --retries 3 --timeout 30)
    unset PYTHONPATH PYTHONDONTWRITEBYTECODE PYTHONHOME PIP_TARGET PIP_PREFIX
    export PIP_USER=0
    local site=()
    [[ $ros == wheels ]] || site=(--system-site-packages)
    "$python" -m venv "${site[@]}" "$venv" &&
        # First, because the source distributions are built with it.
        "${pip[@]}" "$(grep '^setuptools==' "$root/requirements.txt")" &&
        "${pip[@]}" -r "$venv/requirements.txt" || return 1
    # The one package that compiles: without it the rest works.
    "${pip[@]}" "$(grep '^polygon3==' "$root/requirements.txt")" || true
}

# Say in one line why the packages did not install.
_crgame_explain() {
    local log=$venv/install.log reason
    if grep -qE 'NewConnectionError|ConnectTimeout|ReadTimeout|Max retries|ProxyError|resolution' \
        "$log"; then
        reason='the package index cannot be reached: check the network, proxy and pip settings'
    elif grep -q 'No space left' "$log"; then
        reason="the disk is full: .venv takes 1.4 GB in $root"
    else
        reason=$(grep -E '^ERROR|^error|Error:' "$log" | tail -n 1)
    fi
    _crgame_say "could not make .venv: ${reason:-stopped}; the log is $log"
}

# Make .venv anew, alone: other calls wait for the lock. Runs in a subshell of its own.
_crgame_make() {
    local filler='' told=-9 total skip='#'
    [[ $ros == wheels ]] || skip=ros-
    if [[ -d $venv && ! -e $venv/.lock && -n $(ls -A "$venv") ]]; then
        _crgame_say "$venv exists and was not made by scripts/env.sh: move it away"
        return 1
    fi
    total=$(grep -vE "^$skip" "$root/requirements.txt" | grep -c '==')
    mkdir -p "$venv" && touch "$venv/COLCON_IGNORE" && exec 9>"$venv/.lock" || return 1
    until flock --nonblock 9; do
        ((SECONDS == told)) || _crgame_progress \
            'crgame: waiting for another call that makes .venv (%d %%)%.0s%.0s%.0s\n'
        told=$SECONDS
        sleep 0.25
    done
    if _crgame_same; then
        _crgame_stamp
        return
    fi
    # Another terminal has made one of its own here meanwhile.
    [[ ! -e $venv/key ]] || _crgame_fits "$venv" || return 3
    _crgame_say "making ${venv##*/} with Python $version, ROS 2 Jazzy from $ros;" \
        'this happens once and takes about two minutes'
    find "$venv" -mindepth 1 -maxdepth 1 ! -name .lock ! -name COLCON_IGNORE -exec rm -rf {} + ||
        return 1
    printf '%s\n' "$version $ros" >"$venv/key"
    grep -vE "^(polygon3==|setuptools==|$skip)" "$root/requirements.txt" \
        >"$venv/requirements.txt"
    # Ctrl-C does not reach a background job: a group of its own lets us end it with its children.
    trap '[[ -z $filler ]] || kill -TERM -- "-$filler" 2>/dev/null; exit 130' INT TERM HUP
    set -m
    _crgame_fill >"$venv/install.log" 2>&1 &
    filler=$!
    set +m
    if ! _crgame_watch "$filler"; then
        _crgame_explain
        return 1
    fi
    if ! compgen -G "$venv/lib/python*/site-packages/polygon3-*.dist-info" >/dev/null; then
        _crgame_say 'polygon3 did not compile: no planners reactive, reactive-package, idm-package;' \
            'apt install gcc python3-dev, remove .venv and start again'
    fi
    (export PYTHONPATH=$root MPLBACKEND=Agg; "$venv/bin/python" -m crgame_ros.traffic.warm_up) ||
        _crgame_say 'traffic could not be compiled now: that happens when a game has it'
    _crgame_stamp
}

# Put an entry at the front of a path variable, once.
_crgame_prepend() {
    case ":${!1:-}:" in
        *":$2:"*) ;;
        *) export "$1=$2${!1:+:${!1}}" ;;
    esac
}

# Drop the entries of a path variable that hold a file.
_crgame_drop() {
    local entry entries kept=''
    [[ -n ${!1:-} ]] || return 0
    IFS=: read -ra entries <<<"${!1}"
    for entry in "${entries[@]}"; do
        [[ -z $entry || -e $entry/$2 ]] || kept+=${kept:+:}$entry
    done
    export "$1=$kept"
}

_crgame_export_wheels() {
    local libraries
    # Another ROS sourced beside the wheels would shadow them or mix its libraries with theirs.
    _crgame_drop PYTHONPATH rclpy
    _crgame_drop AMENT_PREFIX_PATH share/rclpy
    _crgame_drop LD_LIBRARY_PATH librcl.so
    _crgame_prepend AMENT_PREFIX_PATH "$venv"
    # The wheels restart every Python to set these; setting them here saves 15 ms a process.
    for libraries in "$venv"/lib/python*/site-packages/ros_*.libs "$venv/lib"; do
        _crgame_prepend LD_LIBRARY_PATH "$libraries"
    done
    export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
    if [[ ${RMW_IMPLEMENTATION:-rmw_fastrtps_cpp} != rmw_fastrtps_cpp ]]; then
        _crgame_say "the wheels have rmw_fastrtps_cpp only: ignoring $RMW_IMPLEMENTATION"
    fi
    export RMW_IMPLEMENTATION=rmw_fastrtps_cpp
}

_crgame_export_network() {
    local profile=$root/config/fastdds_loopback.xml
    if [[ ${CRGAME_OPEN_NETWORK:-} == 1 ]]; then
        [[ ${FASTRTPS_DEFAULT_PROFILES_FILE:-} != "$profile" ]] ||
            unset FASTRTPS_DEFAULT_PROFILES_FILE FASTDDS_DEFAULT_PROFILES_FILE \
                ROS_AUTOMATIC_DISCOVERY_RANGE
        return 0
    fi
    export ROS_AUTOMATIC_DISCOVERY_RANGE=${ROS_AUTOMATIC_DISCOVERY_RANGE:-LOCALHOST}
    if [[ -z ${FASTRTPS_DEFAULT_PROFILES_FILE:-}${FASTDDS_DEFAULT_PROFILES_FILE:-} ]]; then
        export FASTRTPS_DEFAULT_PROFILES_FILE=$profile FASTDDS_DEFAULT_PROFILES_FILE=$profile
    fi
}

# What the cockpit's 3D view is drawn with, once; tried again after a day where it cannot be had.
_crgame_three() {
    local version pins=$root/config/page_libraries/package.json
    [[ -r $pins ]] || return 0
    version=$(sed -n 's/^ *"three": "\(.*\)".*/\1/p' "$pins")
    [[ ! -e $venv/share/crgame_ros/three-$version/three.module.js ]] || return 0
    [[ -w $venv && -z $(find "$venv/three.log" -mmin -1440 2>/dev/null) ]] || return 0
    (export PYTHONPATH=$root; "$venv/bin/python" -m crgame_ros.cli cockpit-3d) \
        >"$venv/three.log" 2>&1 ||
        _crgame_say "the cockpit has no 3D view yet ($(tail -n 1 "$venv/three.log"));" \
            '`./crgame cockpit-3d` tries again'
}

_crgame_main() {
    local root venv wanted python version ros made
    root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P) || return 1
    wanted=$(sha256sum <"$root/requirements.txt") || return 1
    for venv in "$root"/.venv "$root"/.venv-*; do
        ! _crgame_ready || break
        venv=''
    done
    if [[ -z $venv ]]; then
        _crgame_choose || return
        made=3
        while ((made == 3)); do
            _crgame_place
            made=0
            (_crgame_make) || made=$?
        done
        ((made == 0)) || return "$made"
    fi
    _crgame_three
    if [[ $ros == wheels ]]; then
        _crgame_export_wheels
    else
        export RMW_IMPLEMENTATION=${RMW_IMPLEMENTATION:-rmw_fastrtps_cpp}
    fi
    _crgame_export_network
    _crgame_prepend PYTHONPATH "$root"
    # The executables that colcon installs start with `env python3`.
    _crgame_prepend PATH "$venv/bin"
    # `crgame` is then a command, unless pip has installed one.
    [[ -e $venv/bin/crgame ]] || ln -sf ../../crgame "$venv/bin/crgame" 2>/dev/null || true
    # One thread for each process: the nodes share few cores, and their matrices are small.
    export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1} OPENBLAS_NUM_THREADS=${OPENBLAS_NUM_THREADS:-1}
    export MPLBACKEND=${MPLBACKEND:-Agg} CRGAME_PYTHON=$venv/bin/python
    unset PYTHONDONTWRITEBYTECODE
}

_crgame_main
