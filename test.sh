#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Build and test with colcon: ./test.sh [pytest arguments], for instance ./test.sh test/driver -k ramp
#
# The last line is pytest's own closing line.
set -euo pipefail
called_from=$PWD
cd -- "$(dirname -- "${BASH_SOURCE[0]}")"
source scripts/env.sh

ROS_DOMAIN_ID=$("$CRGAME_PYTHON" -c \
    'from crgame_ros.ros.environment import free_domain_id; print(free_domain_id())')
# pytest writes into a pipe here: without this its lines would come in blocks.
export ROS_DOMAIN_ID PYTHONUNBUFFERED=1
colcon=("$CRGAME_PYTHON" -m colcon --log-level error --log-base log)

echo "== colcon build"
"${colcon[@]}" build --base-paths . --packages-select crgame_ros

# All tests: a worker more than cores, four at most, as two that run graphs leave something to those
# that compute (test/worker_roles.py). A selection, and whoever debugs, wants one.
workers=()
if (($# == 0)); then
    cores=$(getconf _NPROCESSORS_ONLN)
    workers=(" -n $((cores < 3 ? cores + 1 : 4))" ' --dist=loadgroup' ' --no-loadscope-reorder')
fi

# colcon takes an argument that starts with a dash only behind a blank, which it removes.
arguments=(' -v' "${workers[@]}")
for argument in "$@"; do
    [[ $argument != -* ]] || argument=" $argument"
    [[ $argument != ./* || $PWD == "$called_from" ]] || argument=$called_from/$argument
    arguments+=("$argument")
done

echo "== colcon test (ROS_DOMAIN_ID=$ROS_DOMAIN_ID)"
heartbeat=''
trap '[[ -z $heartbeat ]] || kill "$heartbeat" 2>/dev/null || true' EXIT
exec {never}<> <(:)

# Run pytest by colcon; what it prints goes into a file, too.
run_tests() {
    local output=$1 code=0
    shift
    : >"$output"
    # A word now and then while one long test prints nothing. (A `sleep` would outlive this script.)
    (
        trap - EXIT
        seen=0
        until read -r -t 5 -u "$never"; do
            size=$(stat -c %s "$output")
            ((size != seen)) || echo "   still in the test above, $(date +%T)"
            seen=$size
        done
    ) &
    heartbeat=$!
    "${colcon[@]}" test --base-paths . --packages-select crgame_ros \
        --return-code-on-test-failure --event-handlers console_direct+ \
        --pytest-args "$@" </dev/null 2>&1 | tee "$output" || code=$?
    kill "$heartbeat" 2>/dev/null || true
    ((code == 0)) ||
        "${colcon[@]}" test-result --test-result-base build/crgame_ros --verbose || true
    return "$code"
}

output=log/pytest.txt again='' code=0
closing_line='^=+ .* in [0-9.]+s( \([0-9:]+\))? =+$'
run_tests "$output" "${arguments[@]}" || code=$?

# Tests that keep to the clock share this machine with others, and with whatever else it does: of a
# whole run they get one more try, with nothing beside them.
if ((code != 0 && $# == 0)) && again=$("$CRGAME_PYTHON" scripts/second_try.py "$output"); then
    printf '== a second try, alone:\n%s\n' "$again"
    mapfile -t ids <<<"$again"
    code=0
    run_tests log/pytest-again.txt ' -v' "${ids[@]}" || code=$?
    ((code != 0)) || printf '== passed only the second time, alone:\n%s\n' "$again"
    grep -E "$closing_line" log/pytest.txt | tail -n 1 || true
    output=log/pytest-again.txt
fi

closing=$(grep -E "$closing_line" "$output" | tail -n 1) || {
    echo "test.sh: pytest did not finish; see $output" >&2
    exit 1
}
printf '%s\n' "$closing"
exit "$code"
