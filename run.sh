#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Run a game: ./run.sh [GAME.yaml] [options]; ./run.sh --help tells all.
# The first call makes .venv; PYTHON=python3.12 ./run.sh chooses the interpreter.
set -euo pipefail
root=$(dirname -- "$(readlink -f -- "${BASH_SOURCE[0]}")")
[[ " $* " != *' --help '* && " $* " != *' -h '* ]] || CRGAME_ONLY_HELP=1
# shellcheck source=scripts/env.sh
source "$root/scripts/env.sh"
# Replaced by the launcher, so that a signal to this process reaches the one that owns the nodes.
# Ctrl-C is held back until the launcher listens: Python's own start answers it with a traceback.
exec env --block-signal=INT "$CRGAME_PYTHON" -m crgame_ros.launcher.main "$@"
