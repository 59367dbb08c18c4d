#!/bin/sh
# Sets up .venv: system libraries (with apt where possible), Python, and the pinned packages of some groups.
# Usage, from the root of the project: pipeline/setup.sh [models|cluster|stores|dev ...]. What is
# installed already stays.
# The groups are those of pyproject.toml; their versions are pinned in requirements.lock.
set -eu

VERSIONS="3.11 3.12 3.13"
APT_INSTALL="install -y --no-install-recommends"
KERNEL_PACKAGES="numba scipy pydantic PyYAML tqdm"  # what modules with kernels import

fail() { printf '%s\n' "$@" >&2; exit 1; }

# Prints nothing and succeeds if a Python runs and has a supported version; a version manager's shim may not run.
is_supported() {
    "$1" -c "import ssl, sys, venv; sys.exit('%d.%d' % sys.version_info[:2] not in '$VERSIONS'.split())" 2>/dev/null
}

# The machine's own python3 where its version is supported, else any Python that is.
find_python() {
    for name in python3 python3.13 python3.12 python3.11; do
        IFS=:
        for folder in $PATH /usr/local/bin /usr/bin "${HOME:-/root}/.local/bin"; do
            if is_supported "$folder/$name"; then echo "$folder/$name"; return; fi
        done
        unset IFS
    done
    for python in "${HOME:-/root}"/.pyenv/versions/3.1[123].*/bin/python3; do
        if is_supported "$python"; then echo "$python"; return; fi
    done
}

has_library() {
    PATH="$PATH:/usr/sbin:/sbin" ldconfig -p | grep -qF "$1 "
}

missing_python() {
    python=$(find_python)
    if [ -z "$python" ]; then
        echo python3 python3-venv
    elif ! "$python" -c 'import ensurepip' 2>/dev/null; then
        echo python3-venv
    fi
}

missing_libraries() {
    grep -v '^#' pipeline/libraries.txt | while read -r library package _; do
        if ! has_library "$library"; then echo "$package"; fi
    done
}

# Sets `sudo` to what lets apt install packages, or says who has to install them.
find_sudo() {
    if ! command -v apt-get >/dev/null; then
        fail "Shapemill needs what Debian calls: $*" "Install that, then run make again."
    elif [ "$(id -u)" = 0 ]; then
        sudo=""
    elif command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
        sudo="sudo"
    else
        fail "Shapemill needs packages that only root may install. Run this, then make again:" \
            "    sudo apt-get update && sudo apt-get $APT_INSTALL $*"
    fi
}

install_packages() {
    echo "installing $*"
    if [ -z "$updated" ]; then
        # shellcheck disable=SC2086
        $sudo apt-get update -q || echo "apt-get update failed; trying with the lists that are there" >&2
        updated=yes
    fi
    # A set-up that was stopped may have left an apt-get that goes on.
    # shellcheck disable=SC2086
    $sudo env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=120 $APT_INSTALL "$@" ||
        fail "apt-get failed. This must work before make can go on:" "    $sudo apt-get $APT_INSTALL $*"
}

python_packages=$(missing_python | tr '\n' ' ') libraries=$(missing_libraries | tr '\n' ' ')
updated="" apt=""
# shellcheck disable=SC2086
if [ -n "${python_packages% }${libraries% }" ]; then find_sudo $python_packages $libraries; fi
# shellcheck disable=SC2086
if [ -n "${python_packages% }" ]; then install_packages $python_packages; fi
# Nothing that set-up runs loads the libraries: they come while pip works.
# shellcheck disable=SC2086
if [ -n "${libraries% }" ]; then install_packages $libraries & apt=$!; fi

python=$(find_python)
[ -n "$python" ] || fail "There is no Python of $VERSIONS that runs. Install one, then run make again."
if ! is_supported .venv/bin/python || ! .venv/bin/python -m pip --version >/dev/null 2>&1; then
    echo "creating .venv with $("$python" --version) ($python)"
    "$python" -m venv --clear .venv
fi
requirements=.venv/requirements.txt
.venv/bin/python - "$@" > "$requirements" <<'END'
import sys, tomllib
with open("pyproject.toml", "rb") as stream:
    facts = tomllib.load(stream)
project = facts["project"]
groups = [project["optional-dependencies"][group] for group in sys.argv[1:]]
print(*facts["build-system"]["requires"], *project["dependencies"], *(name for group in groups for name in group), sep="\n")
END
grep '^--' requirements.lock >> "$requirements"
count() { grep -c "$1" .venv/install.log || true; }

# Waits for the packages that apt installs; without them set-up ends, and apt has said why.
wait_for_apt() {
    if [ -n "$apt" ]; then wait "$apt" || exit 1; apt=""; fi
}

# Installs with pip, and says every five seconds how far it is; pip itself says nothing while it unpacks.
pip_install() {
    .venv/bin/python -m pip install --disable-pip-version-check --no-compile --progress-bar off "$@" > .venv/install.log 2>&1 &
    pip=$!
    seconds=0
    while kill -0 "$pip" 2>/dev/null; do
        sleep 1
        seconds=$((seconds + 1))
        if [ -n "$apt" ] && ! kill -0 "$apt" 2>/dev/null; then wait_for_apt; fi
        if [ $((seconds % 5)) = 0 ]; then
            found=$(count '^Collecting\|^Requirement already')
            new=$(find .venv/lib -maxdepth 3 -name '*.dist-info' -newer .venv/requirements.txt | wc -l)
            echo "set-up: $found packages found, $(count '^ *Downloading\|^ *Using cached\|^Processing') fetched," \
                "$new installed, $(wc -l < .venv/kernels.log) kernels compiled, ${seconds}s elapsed"
        fi
    done
    wait "$pip" || fail "$(tail -n 20 .venv/install.log)" "pip failed; all that it said is in .venv/install.log"
    pip=""
}

echo "installing $(grep -c '^[^-]' "$requirements") packages and what they need into .venv; the first time takes minutes"
# What runs in the background ignores Ctrl-C, and dash runs no EXIT trap for a signal.
pip="" kernels=""
trap 'for process in $pip $kernels; do kill "$process" 2>/dev/null || true; done' EXIT
trap 'exit 130' INT
trap 'exit 143' TERM
# Kernels need few of them: they are compiled while the others come. A first run compiles those that are left.
: > .venv/kernels.log
# shellcheck disable=SC2086
pip_install --constraint requirements.lock $(grep '^--' requirements.lock) $KERNEL_PACKAGES
nice .venv/bin/python -m pipeline.compile_kernels > .venv/kernels.log 2> .venv/kernels-errors.log &
kernels=$!
pip_install --constraint requirements.lock --requirement "$requirements"
pip_install --no-deps --no-build-isolation --editable .
wait_for_apt
