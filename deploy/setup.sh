# shellcheck shell=bash
# Sets up .venv in the checkout; sourced by launch.sh and test.sh.
#
# A stamp in .venv, written last, says what is installed: for which folder, and from which
# pyproject.toml and constraints.txt. A set-up that was cut off leaves a mark instead and is begun anew.

root=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
venv=$root/.venv

# set_up run | dev: make sure that .venv can run the fleet, or also check the code.
set_up() {
    local wanted
    wanted=$(printf '%s\n' "$root" && cat "$root/pyproject.toml" "$root/constraints.txt")
    stamped "$1" "$wanted" && return
    exec 9<"$root/deploy/setup.sh"
    if command -v flock >/dev/null; then flock 9; fi
    if ! stamped "$1" "$wanted"; then install_into_venv "$1" "$wanted"; fi
    exec 9<&-
}

# stamped KIND WANTED: whether .venv holds what is wanted; what checks the code also runs it.
stamped() {
    local kind
    [ -x "$venv/bin/qswarm" ] && [ ! -e "$venv/unfinished" ] || return 1
    for kind in "$1" dev; do
        if [ -e "$venv/set-up-$kind" ] && [ "$(<"$venv/set-up-$kind")" = "$2" ]; then return 0; fi
    done
    return 1
}

install_into_venv() {
    local what=$root
    [ "$1" = run ] || what="${root}[$1]"
    say "setting up $venv for '$1', once (200 MB or so are downloaded) ..."
    make_venv
    touch "$venv/unfinished"
    rm -f "$venv"/set-up-*
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check \
        --constraint "$root/constraints.txt" --editable "$what" \
        || fail "set-up failed, see above; the next start begins it anew"
    printf '%s\n' "$2" >"$venv/set-up-$1"
    rm "$venv/unfinished"
    say "set up in $SECONDS s"
}

# A finished .venv is kept; an unfinished or broken one, or one that was moved, is made anew.
make_venv() {
    local python=${PYTHON:-python3} version
    if [ ! -e "$venv/unfinished" ] && [[ $("$venv/bin/pip" --version 2>/dev/null) == *" $venv/"* ]]; then
        return
    fi
    version=$("$python" -c 'import platform; print(platform.python_version())') \
        || fail "no '$python' here; install Python 3.11 or newer, or name one: PYTHON=python3.11"
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' \
        || fail "$python is Python $version, 3.11 or newer is needed; name one: PYTHON=python3.11"
    "$python" -m venv --clear "$venv" \
        || fail "'$python -m venv' failed; on Debian and Ubuntu: apt-get install python3-venv"
}

say() { printf '%s\n' "$*" >&2; }

fail() {
    say "$*"
    exit 2
}
