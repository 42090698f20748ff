#!/usr/bin/env bash
# Copyright 2026 The crgame_ros authors
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
output=log/pytest.txt
: >"$output"
# A word now and then while one long test prints nothing. (A `sleep` would outlive this script.)
exec {never}<> <(:)
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
trap 'kill "$heartbeat" 2>/dev/null || true' EXIT
code=0
"${colcon[@]}" test --base-paths . --packages-select crgame_ros --return-code-on-test-failure \
    --event-handlers console_direct+ --pytest-args "${arguments[@]}" </dev/null 2>&1 |
    tee "$output" || code=$?
kill "$heartbeat" 2>/dev/null || true
((code == 0)) || "${colcon[@]}" test-result --test-result-base build/crgame_ros --verbose || true

closing=$(grep -E '^=+ .* in [0-9.]+s( \([0-9:]+\))? =+$' "$output" | tail -n 1) || {
    echo "test.sh: pytest did not finish; see $output" >&2
    exit 1
}
printf '%s\n' "$closing"
exit "$code"
