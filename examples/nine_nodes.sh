#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# A whole run with each node started by its own `ros2 run`, in the order you like; run.sh does the
# same in one command. The run ends after some simulated seconds, and its recording becomes a
# CommonRoad scenario.
#
#   source scripts/env.sh && examples/nine_nodes.sh [GAME [SECONDS [FOLDER]]]
#
# GAME has one human that its game file drives, and one AV. Each node may be ended and started
# again at any time, also from another shell after the same `crgame dds-profile`.
set -eu
game=${1:-cut_in} seconds=${2:-10} folder=${3:-runs/nine_nodes}
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
crgame=("${CRGAME_PYTHON:-python3}" -m crgame_ros.cli)
# The nodes take the run's topics from each other alone.
profile=$("${crgame[@]}" dds-profile "$folder/fastdds.xml")
eval "$profile"

# node NAME EXECUTABLE [PARAMETER:=VALUE …]: start a node in the background.
node() {
    local name=$1 executable=$2 parameters=()
    shift 2
    for parameter in "$@"; do parameters+=(-p "$parameter"); done
    if command -v ros2 >/dev/null; then
        ros2 run crgame_ros "$executable" --ros-args -r "__node:=$name" "${parameters[@]}" &
    else # the packages from PyPI have rclpy, but not the command ros2
        "${CRGAME_PYTHON:-python3}" -m "crgame_ros.nodes.$executable" \
            --ros-args -r "__node:=$name" "${parameters[@]}" &
    fi
}

companions='planner_node_av0, driver_node_hv0, recorder_node, drivability_node, timesync_node'
node recorder_node recorder_node "directory:=$folder/bag"
node planner_node_av0 planner_node vehicle:=av0
node driver_node_hv0 driver_node vehicle:=hv0
node drivability_node drivability_node
node criticality_node criticality_node
node timesync_node timesync_node
node marker_node marker_node
node cockpit_node cockpit_node "directory:=$folder/cockpit"
others=$(jobs -p)
# shellcheck disable=SC2086 # one process id is one word
trap 'kill $others 2>/dev/null || true' EXIT

# It waits for its companions before the first step, and ends with the run.
node sim_node sim_node "game:=$game" "duration:=$seconds" "folder:=$folder" \
    "wait_for:=[$companions]"
wait $!
sleep 1 # until the recorder has the last messages and has closed the bag
# shellcheck disable=SC2086
kill $others
# shellcheck disable=SC2086
wait $others || true
"${crgame[@]}" convert "$folder/bag" --out "$folder"
