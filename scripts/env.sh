# shellcheck shell=bash
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# The environment of every command: `source scripts/env.sh` from bash, as run.sh and test.sh do.
#
# The first call installs requirements.txt into .venv (scripts/make_venv.sh); later calls only set
# variables. Where a ROS 2 Jazzy installation is sourced, .venv-jazzy is used instead and has no
# ROS of its own.
#
#   PYTHON=python3.12      the interpreter, 3.11 or 3.12; in .venv-3.12 if .venv has another one
#   CRGAME_DEVELOP=1       install requirements-dev.txt as well
#   CRGAME_ONLY_HELP=1     install nothing: --help needs no packages
#   CRGAME_OPEN_NETWORK=1  let ROS traffic leave this machine
#
# Sets CRGAME_PYTHON, the interpreter to run. Returns 2 where there is no usable Python, 1 where the
# packages cannot be installed, 130 after Ctrl-C.

_crgame_say() {
    printf 'crgame: %s\n' "$*" >&2
}

# Set python to the first interpreter that fits, and version.
_crgame_choose_python() {
    local candidate found seen=''
    for candidate in ${PYTHON:-python3 python3.12 python3.11}; do
        # The real interpreter: an environment made from another one would depend on both.
        found=$("$candidate" -c 'import sys
print("%d.%d" % sys.version_info[:2], getattr(sys, "_base_executable", sys.executable))' \
            2>/dev/null) || continue
        version=${found%% *} python=${found#* }
        [[ $version != 3.11 && $version != 3.12 ]] || return 0
        seen+=" ($candidate is $version)"
    done
    _crgame_say "needs Python 3.11 or 3.12, found none${seen:- at ${PYTHON:-python3}};" \
        'install one or name it: PYTHON=/path/to/python3.12'
    return 2
}

# Whether an installed Jazzy is sourced, and not the wheels of an environment.
_crgame_installed_ros() {
    local entry
    [[ ${ROS_DISTRO:-} == jazzy ]] || return 1
    for entry in ${AMENT_PREFIX_PATH//:/ }; do
        [[ ! -e $entry/share/rclpy || -e $entry/pyvenv.cfg ]] || return 0
    done
    return 1
}

# Whether the sourced Jazzy has rclpy for the chosen Python.
_crgame_sourced_ros() {
    local entry
    _crgame_installed_ros || return 1
    for entry in ${AMENT_PREFIX_PATH//:/ }; do
        [[ ! -d $entry/lib/python$version/site-packages/rclpy || -e $entry/pyvenv.cfg ]] ||
            return 0
    done
    _crgame_say "the sourced ROS 2 Jazzy has no rclpy for Python $version: taking ROS from wheels"
    return 1
}

# Whether the environment contains what is wanted, by the stamp in it.
_crgame_ready() {
    [[ -x $venv/bin/python && -r $venv/stamp ]] && grep -qx "$wanted" "$venv/stamp"
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
    IFS=: read -ra entries <<<"${!1:-}"
    for entry in "${entries[@]}"; do
        [[ -z $entry || -e $entry/$2 ]] || kept+=${kept:+:}$entry
    done
    export "$1=$kept"
}

# Set what the ROS wheels need; another ROS beside them would be mixed with theirs.
_crgame_export_wheels() {
    local libraries
    _crgame_drop PYTHONPATH rclpy
    _crgame_drop AMENT_PREFIX_PATH share/rclpy
    _crgame_drop LD_LIBRARY_PATH librcl.so
    _crgame_prepend AMENT_PREFIX_PATH "$venv"
    # The wheels restart every Python to set these; setting them here saves 15 ms a process.
    for libraries in "$venv"/lib/python*/site-packages/ros_*.libs "$venv/lib"; do
        _crgame_prepend LD_LIBRARY_PATH "$libraries"
    done
    export ROS_DISTRO=jazzy _ROS_WHEELS_BOOTSTRAP_COMPLETE=1 RMW_IMPLEMENTATION=rmw_fastrtps_cpp
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

_crgame_main() {
    local root venv ros=wheels wanted python='' version='' pins
    root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P) || return 1
    venv=$root/.venv
    if [[ -n ${PYTHON:-} || ! -x $venv/bin/python ]] || _crgame_installed_ros; then
        _crgame_choose_python || return
        ! _crgame_sourced_ros || ros=jazzy venv=$root/.venv-jazzy
        [[ ! -e $venv/stamp || -e $venv/bin/python$version ]] || venv+=-$version
    fi
    pins=("$root"/requirements{,-planners}.txt)
    [[ ${CRGAME_DEVELOP:-} != 1 ]] || pins+=("$root/requirements-dev.txt")
    wanted=$(cat "${pins[@]}" | sha256sum)
    if ! _crgame_ready; then
        [[ -n $python ]] || _crgame_choose_python || return
        if [[ ${CRGAME_ONLY_HELP:-} == 1 ]]; then
            export PYTHONPATH=$root CRGAME_PYTHON=$python
            return
        fi
        "$root/scripts/make_venv.sh" "$venv" "$python" "$ros" "$wanted" || return
    fi
    if [[ $ros == wheels ]]; then
        _crgame_export_wheels
    fi
    _crgame_export_network
    _crgame_prepend PYTHONPATH "$root"
    # The executables that colcon installs start with `env python3`.
    _crgame_prepend PATH "$venv/bin"
    # One thread for each process: the nodes share few cores, and their matrices are small.
    export OMP_NUM_THREADS=${OMP_NUM_THREADS:-1} OPENBLAS_NUM_THREADS=${OPENBLAS_NUM_THREADS:-1}
    export MPLBACKEND=${MPLBACKEND:-Agg} CRGAME_PYTHON=$venv/bin/python
    unset PYTHONDONTWRITEBYTECODE
}

_crgame_main
