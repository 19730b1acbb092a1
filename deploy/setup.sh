# shellcheck shell=bash
# Sets up .venv in the checkout; sourced by launch.sh and test.sh.
#
# A stamp in .venv, written last, records what is installed: the folder, pyproject.toml and
# constraints.txt. An interrupted set-up leaves the file "unfinished" instead, and is repeated.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
venv=$root/.venv

# set_up run | dev: prepare .venv to run the fleet, or also to check the code.
set_up() {
    local required
    required=$(printf '%s\n' "$root" && cat "$root/pyproject.toml" "$root/constraints.txt")
    stamped "$1" "$required" && return
    exec 9<"$root/deploy/setup.sh"
    if command -v flock >/dev/null; then flock 9; fi
    if ! stamped "$1" "$required"; then install_into_venv "$1" "$required"; fi
    exec 9<&-
}

# stamped KIND REQUIRED: whether .venv holds what is required; "dev" includes "run".
stamped() {
    local kind
    [ -x "$venv/bin/qswarm" ] && [ ! -e "$venv/unfinished" ] || return 1
    for kind in "$1" dev; do
        if [ -e "$venv/set-up-$kind" ] && [ "$(<"$venv/set-up-$kind")" = "$2" ]; then return 0; fi
    done
    return 1
}

install_into_venv() {
    local what=$root bytecode=--no-compile
    # Python writes the bytecode of a module when it is first imported, and of all that is installed
    # little ever is. Only where it may not write any does pip, which takes half of the set-up.
    [ -z "${PYTHONDONTWRITEBYTECODE-}" ] || bytecode=--compile
    [ "$1" = run ] || what="${root}[$1]"
    say "setting up $venv for '$1', once (200 MB or so are downloaded) ..."
    make_venv
    touch "$venv/unfinished"
    rm -f "$venv"/set-up-*
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check "$bytecode" \
        --constraint "$root/constraints.txt" --editable "$what" \
        || fail "set-up failed, see above; the next start repeats it"
    printf '%s\n' "$2" >"$venv/set-up-$1"
    rm "$venv/unfinished"
    say "set up in $SECONDS s"
}

# Keeps a finished .venv; creates it again if it is unfinished, broken, or was moved.
make_venv() {
    local python=${PYTHON:-python3} version
    if [ ! -e "$venv/unfinished" ] && [[ $("$venv/bin/pip" --version 2>/dev/null) == *" $venv/"* ]]; then
        return
    fi
    version=$("$python" -c 'import platform; print(platform.python_version())') \
        || fail "'$python' not found; install Python 3.11 or newer, or set PYTHON=python3.11"
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
        || fail "$python is Python $version; 3.11 or newer is needed, for example PYTHON=python3.11"
    "$python" -m venv --clear "$venv" \
        || fail "'$python -m venv' failed; on Debian and Ubuntu: apt-get install python3-venv"
}

say() { printf '%s\n' "$*" >&2; }

fail() {
    say "$*"
    exit 2
}
