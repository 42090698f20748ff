#!/usr/bin/env bash
# SPDX-FileCopyrightText: 2026 The crgame_ros authors
# SPDX-License-Identifier: Apache-2.0
#
# Install the pinned packages: make_venv.sh FOLDER PYTHON wheels|jazzy STAMP; scripts/env.sh calls it.
#
# uv installs, the one on the PATH or one in a folder of its own: it is ten times as fast as pip.
set -euo pipefail
venv=$1 python=$2 ros=$3 wanted=$4
root=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd -P)

say() {
    printf 'crgame: %s\n' "$*" >&2
}

fail() {
    say "$@"
    exit 1
}

pages=
trap '[[ -z $pages ]] || kill "$pages" 2>/dev/null || true
    say "stopped; the next start goes on from here"; exit 130' INT TERM HUP
# uv locks .lock itself.
if ! { mkdir -p "$venv" && touch "$venv/COLCON_IGNORE" && exec 9>"$venv/making.lock"; } 2>/dev/null; then
    fail "cannot write to $venv: copy the checkout to a folder of your own"
fi
flock -n 9 || {
    say 'waiting for another start that installs packages'
    flock 9
}
if [[ -e $venv/stamp ]] && grep -qx "$wanted" "$venv/stamp"; then
    exit
fi

say "installing packages into ${venv##*/}, once: $("$python" --version), ROS 2 Jazzy from $ros"
# pip's settings serve uv as well, and so do the certificates of the machine.
index=${PIP_INDEX_URL:-$("$python" -m pip config get global.index-url 2>/dev/null)} || true
[[ -z $index ]] || export UV_DEFAULT_INDEX=${UV_DEFAULT_INDEX:-$index}
export UV_SYSTEM_CERTS=1 UV_NATIVE_TLS=1
unset PYTHONPATH PYTHONHOME PYTHONDONTWRITEBYTECODE VIRTUAL_ENV CONDA_PREFIX PIP_TARGET PIP_PREFIX
# The one on the PATH may be the link below, which must not lead to itself.
if ! uv=$(realpath -e "$(command -v uv)" 2>/dev/null); then
    uv=$venv/uv/bin/uv
    if [[ ! -x $uv ]]; then
        "$python" -m venv "$venv/uv" >/dev/null ||
            fail "$python cannot make environments: apt install python3-venv, or install uv"
        "$venv/uv/bin/python" -m pip --disable-pip-version-check --quiet install uv==0.13.9 ||
            fail 'uv, which installs packages, cannot be installed: check the network, or install uv'
        "$venv/uv/bin/python" -m pip uninstall --quiet --yes setuptools pip 2>/dev/null || true
    fi
fi
unreachable='the packages are not installed: see above; check network and disk, or name your index'
unreachable+=' of packages in UV_INDEX'
site=() without='^$'
[[ $ros != jazzy ]] || site=(--system-site-packages) without='^ros-'
# With pip, so that `pip install` after sourcing scripts/env.sh means this environment.
if [[ ! -e $venv/stamp ]]; then
    "$uv" venv --quiet --seed --allow-existing --python "$python" "${site[@]}" "$venv" ||
        fail "$unreachable"
fi

# Not in the project's folder, where uv would leave out what pyproject.toml excludes.
install() {
    (cd / && "$uv" pip install --no-deps --python "$venv/bin/python" "$@")
}

pins=$root/requirements.txt
[[ ${CRGAME_DEVELOP:-} != 1 ]] || pins=$root/requirements-dev.txt
# The lines of a package with its hashes are one for sed and grep.
sed -e ':a' -e '/\\$/{N;s/\\\n//;ba}' "$pins" | grep -v "$without" >"$venv/requirements.txt"
# A line for each large download, not one for each of a hundred packages.
install -r "$venv/requirements.txt" 2> >(grep -v '^ [-+~] ' >&2) || fail "$unreachable"
# 45 MB that are never used: ROS headers, as nothing is compiled against them, and tests of packages.
rm -rf "$venv/include"
find "$venv"/lib/python*/site-packages -type d \
    -regex '.*/site-packages/\(numba\|networkx\|numpy\|pyarrow\|scipy\)/\(.*/\)?tests' \
    -prune -exec rm -rf {} +
# 70 MB that wheels contain several times, since they cannot hold links.
hardlink --content --quiet --minimum-size 64KiB "$venv" 2>/dev/null || true
ln -sf ../../crgame "$venv/bin/crgame"
ln -sf "$uv" "$venv/bin/uv"

# Without the lock: what is left of a stopped start must not hold up the next.
PYTHONPATH=$root "$venv/bin/python" -m crgame_ros.cli page-libraries >"$venv/pages.log" 2>&1 9>&- &
pages=$!
say 'compiling polygon3 for the planners that need it: up to half a minute'
planners=$root/requirements-planners.txt
# The others declare Python < 3.12, though they work on it.
# In a shell of its own: what the trap says is not for the file.
if (install --quiet "$(grep '^polygon3' "$planners")") 2>"$venv/polygon3.log"; then
    grep -v '^polygon3' "$planners" >"$venv/planners.txt"
    install --quiet --python-version 3.11 -r "$venv/planners.txt"
else
    say 'no planners reactive, reactive-package, idm-package: polygon3 does not compile;' \
        "apt install gcc python3-dev, remove ${venv##*/} and start again"
fi
wait "$pages" || say "pages have no 3D view and no plots: $(tail -n 1 "$venv/pages.log");" \
    './crgame page-libraries tries again'
# What serves developers serves everybody.
printf '%s\n' "$wanted" "$(cat "$root"/requirements{,-planners}.txt | sha256sum)" >"$venv/stamp"
