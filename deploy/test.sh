#!/usr/bin/env bash
# Sets up .venv if needed, then runs every check: format, lint, types, import contracts, tests.
# Arguments go to pytest. The exit status is 0 only if every check passed.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=deploy/setup.sh
source "$here/setup.sh"

# The source is checked, not what may have been compiled of it: tests replace parts of it.
export QSWARM_PURE=1
# Hundreds of processes start here. Without bytecode on disk each would first compile the code, and
# each worker of pytest all tests, which takes longer than most of them.
unset PYTHONDONTWRITEBYTECODE
failed=0

# check NAME COMMAND: print one line with the result, and the output only of a failed check.
check() {
    local name=$1 output
    shift
    if output=$("$@" 2>&1); then
        printf '%-16s passed\n' "$name"
    else
        printf '%-16s FAILED\n%s\n' "$name" "$output"
        failed=1
    fi
}

# begin NAME COMMAND: run a check meanwhile, in the time that others leave; end_begun shows it.
begin() {
    begun=$1 begun_output=$(mktemp)
    shift
    nice "$@" >"$begun_output" 2>&1 &
    begun_pid=$!
}

# end_begun: wait for the check that was begun; print its last line, and all where it failed.
end_begun() {
    if wait "$begun_pid"; then
        printf '%-16s %s\n' "$begun" "$(tail -n 1 "$begun_output")"
    else
        printf '%-16s FAILED\n%s\n' "$begun" "$(<"$begun_output")"
        failed=1
    fi
    rm "$begun_output"
}

set_up dev
cd "$root"
# One core compiles while the other checks, and then while processes, which mostly wait, are tested.
if [ $# -eq 0 ]; then
    # Both use mypy: the compiler keeps off the other's cache.
    begin compiled env MYPY_CACHE_DIR=/dev/null "$venv/bin/python" -m tests.same_compiled
fi
check format "$venv/bin/ruff" format --check .
check lint "$venv/bin/ruff" check .
check types "$venv/bin/mypy"
check imports "$venv/bin/lint-imports"
printf '%-16s ...\n' tests
if [ $# -gt 0 ]; then
    "$venv/bin/pytest" "$@" || failed=1
else
    # The tutorial is the longest of them: begun first, it is not waited for at the end.
    processes=(tests/tutorial tests/processes)
    "$venv/bin/pytest" "${processes[@]}" -m "processes and not real_time" --numprocesses 3 \
        || failed=1
    end_begun
    # A late host fails fleets on the wall clock, so only compiled ones share it.
    at_once=0
    if [ -f build/compiled/manifest.json ]; then at_once=3; fi
    QSWARM_PURE=0 "$venv/bin/pytest" "${processes[@]}" -m "processes and real_time" \
        --numprocesses "$at_once" || failed=1
    # Virtual tests share the cores: half of the files for each, and at the end single tests of who
    # has more left. Flights run compiled if the compiler ran.
    virtual=(--numprocesses auto --dist worksteal)
    "$venv/bin/pytest" -m "not processes and not flight" "${virtual[@]}" || failed=1
    QSWARM_PURE=0 "$venv/bin/pytest" -m "not processes and flight" "${virtual[@]}" || failed=1
fi
exit "$failed"
