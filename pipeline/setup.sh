#!/bin/sh
# Sets up .venv: system libraries (with apt where it may), Python 3.11, the exact versions of requirements.lock, and the
# command shapemill.
# Run by make from the root of the project; does nothing twice.
set -eu

fail() { printf '%s\n' "$@" >&2; exit 1; }

# A Python 3.11 that really runs: a version manager's shim on the PATH may not.
find_python() {
    IFS=:
    for folder in $PATH /usr/local/bin /usr/bin "${HOME:-/root}/.local/bin"; do
        if "$folder/python3.11" -c 'import ssl, venv' 2>/dev/null; then echo "$folder/python3.11"; return; fi
    done
    for python in "${HOME:-/root}"/.pyenv/versions/3.11.*/bin/python3.11; do
        if "$python" -c 'import ssl, venv' 2>/dev/null; then echo "$python"; return; fi
    done
}

has_library() {
    PATH="$PATH:/usr/sbin:/sbin" ldconfig -p | grep -qF "$1 "
}

missing_packages() {
    python=$(find_python)
    if [ -z "$python" ]; then
        echo python3.11 python3.11-venv
    elif ! "$python" -c 'import ensurepip' 2>/dev/null; then
        echo python3.11-venv
    fi
    grep -v '^#' pipeline/libraries.txt | while read -r library package _; do
        if ! has_library "$library"; then echo "$package"; fi
    done
}

install_packages() {
    command="apt-get install -y --no-install-recommends $*"
    if ! command -v apt-get >/dev/null; then
        fail "Shapemill needs what Debian 12 calls: $*" "Install that, then run make again."
    elif [ "$(id -u)" = 0 ]; then
        sudo=""
    elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
        sudo="sudo"
    else
        fail "Shapemill needs packages that only root may install. Run this, then make again:" \
            "    sudo apt-get update && sudo $command"
    fi
    echo "installing $*"
    # shellcheck disable=SC2086
    $sudo apt-get update -q || echo "apt-get update failed; trying with the lists that are there" >&2
    # shellcheck disable=SC2086
    $sudo env DEBIAN_FRONTEND=noninteractive $command || fail "apt-get failed. This must work before make can go on:" \
        "    $sudo $command"
}

packages=$(missing_packages | tr '\n' ' ')
# shellcheck disable=SC2086
if [ -n "${packages% }" ]; then install_packages $packages; fi

python=$(find_python)
[ -n "$python" ] || fail "There is still no Python 3.11 that runs. Install one, then run make again."
if ! .venv/bin/python -c 'import sys, pip; sys.exit(sys.version_info[:2] != (3, 11))' 2>/dev/null; then
    echo "making .venv with $python"
    "$python" -m venv --clear .venv
fi
echo "installing the versions of requirements.lock into .venv; the first time this takes some minutes"
.venv/bin/python -m pip install -qq --disable-pip-version-check -r requirements.lock
.venv/bin/python -m pip install -qq --disable-pip-version-check --no-deps --no-build-isolation --editable .
