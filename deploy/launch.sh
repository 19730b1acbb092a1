#!/usr/bin/env bash
# Sets up .venv if needed, then runs a scenario with real processes:
#
#     deploy/launch.sh [SCENARIO] [options of 'qswarm run']
#
# The default scenario is wedge-9: nine agents that form a pyramidal wedge.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=deploy/setup.sh
source "$here/setup.sh"

# names_scenario ARGUMENTS: whether one is a scenario: the first, or a .toml file anywhere.
names_scenario() {
    local argument
    case ${1--} in -*) ;; *) return 0 ;; esac
    for argument; do
        case $argument in -* | *=*) ;; *.toml) return 0 ;; esac
    done
    return 1
}

set_up run
names_scenario "$@" || set -- "$here/scenarios/wedge-9.toml" "$@"
exec "$venv/bin/qswarm" run "$@"
