#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
set -euo pipefail
usage='Build with colcon and run the tests.

  ./test.sh                       what decides whether a change lands: ten to twenty-five minutes on two cores
  ./test.sh --quick               without ROS graphs and browsers: three to ten minutes
  ./test.sh --all                 everything: every case of each matrix, what clocks show, coverage
  ./test.sh test/driver -k ramp   some tests, by arguments of pytest

The last line is the closing line of pytest.'
tier=
case ${1:-} in
    --help | -h)
        printf '%s\n' "$usage"
        exit
        ;;
    --quick | --all)
        tier=${1#--}
        shift
        ;;
esac
called_from=$PWD
cd -- "$(dirname -- "$(readlink -f -- "${BASH_SOURCE[0]}")")"
export CRGAME_DEVELOP=1
source scripts/env.sh
# The installed copy runs what is compiled for the checkout.
export NUMBA_CACHE_DIR=$PWD/crgame_ros/traffic/__pycache__
# When pytest first collects the tests it rewrites all their assertions: once, beside the compiler,
# instead of in each of its workers.
[[ -d test/__pycache__ ]] || "$CRGAME_PYTHON" -m pytest --collect-only -qq >/dev/null 2>&1 &
"$CRGAME_PYTHON" -m crgame_ros.traffic.warm_up
wait

ROS_DOMAIN_ID=$("$CRGAME_PYTHON" -c \
    'from crgame_ros.ros.environment import free_domain_id; print(free_domain_id())')
# pytest writes into a pipe here: without this its lines would come in blocks.
export ROS_DOMAIN_ID PYTHONUNBUFFERED=1
colcon=("$CRGAME_PYTHON" -m colcon --log-level error --log-base log)

echo "== colcon build"
"${colcon[@]}" build --base-paths . --packages-select crgame_ros

# Run pytest by colcon. It takes an argument that starts with a dash only behind a blank, which it
# removes.
run_tests() {
    local argument arguments=() code=0
    for argument in "$@"; do
        [[ $argument != -* ]] || argument=" $argument"
        [[ $argument != ./* || $PWD == "$called_from" ]] || argument=$called_from/$argument
        arguments+=("$argument")
    done
    echo "== colcon test $*"
    "${colcon[@]}" test --base-paths . --packages-select crgame_ros \
        --return-code-on-test-failure --event-handlers console_direct+ \
        --pytest-args "${arguments[@]}" </dev/null 2>&1 | tee log/pytest.txt || code=$?
    ((code == 0)) ||
        "${colcon[@]}" test-result --test-result-base build/crgame_ros --verbose || true
    grep -E '^=+ .* in [0-9.]+s( \([0-9:]+\))? =+$' log/pytest.txt | tail -n 1 || {
        echo 'test.sh: pytest did not finish; see log/pytest.txt' >&2
        code=1
    }
    return "$code"
}

# A worker for each core, four at most: one more makes tests of graphs wait for each other.
cores=$(getconf _NPROCESSORS_ONLN)
workers=(-n "$((cores < 4 ? cores : 4))" --dist=loadgroup --no-loadscope-reorder)
if (($# > 0)); then
    run_tests -v ${tier:+"--tier=$tier"} "$@"
elif [[ $tier == all ]]; then
    code=0
    measured=(--cov=crgame_ros --cov-branch)
    run_tests -v --tier=all -m 'not clock and not graph' "${workers[@]}" \
        "${measured[@]}" --cov-report= || code=$?
    # One after the other: every case of every graph and browser is too much at once for two cores.
    run_tests -v --tier=all -m 'graph and not clock' \
        "${measured[@]}" --cov-append --cov-report=term:skip-covered || code=$?
    # Without coverage, which slows every process of a graph.
    run_tests -v --tier=all -m clock || code=$?
    exit "$code"
else
    run_tests -v --tier="${tier:-default}" "${workers[@]}"
fi
