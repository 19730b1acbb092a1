#!/usr/bin/env bash
# Sets up .venv if needed, then runs every check: format, lint, types, import contracts, tests.
# Arguments go to pytest. The exit status is 0 only if all of them passed.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=deploy/setup.sh
source "$here/setup.sh"

failed=0

# check NAME COMMAND: say in one line whether it passed; show what it said only if it did not.
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

set_up dev
cd "$root"
check format "$venv/bin/ruff" format --check .
check lint "$venv/bin/ruff" check .
check types "$venv/bin/mypy"
check imports "$venv/bin/lint-imports"
printf '%-16s ...\n' tests
if [ $# -gt 0 ]; then
    "$venv/bin/pytest" "$@" || failed=1
else
    # What is timed by the wall clock runs alone; the rest shares the cores, a file to a worker.
    "$venv/bin/pytest" -m "not processes" --numprocesses auto --dist loadfile || failed=1
    "$venv/bin/pytest" -m processes || failed=1
fi
exit "$failed"
