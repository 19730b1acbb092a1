#!/usr/bin/env bash
# A fleet without the launcher: netem, the world and the agents, each started by a plain command.
#   deploy/by-hand.sh [SCENARIO [DIR]]
# SCENARIO: a scenario file or a name of the library, by default wedge-9. DIR: a new folder, by
# default in runs. QSWARM_PORT sets a port other than 7447. The commands can also be typed into
# different shells.
set -euo pipefail
cd "$(dirname "$0")/.."

case ${1-} in
    -h | --help)
        sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' deploy/by-hand.sh
        exit 0
        ;;
    -*)
        echo "$1: no such option; deploy/by-hand.sh [SCENARIO [DIR]]" >&2
        exit 2
        ;;
esac

scenario=${1:-deploy/scenarios/wedge-9.toml}
python=.venv/bin/python
endpoint=tcp/127.0.0.1:${QSWARM_PORT:-7447}
run=by-hand
out=${2:-runs/by-hand-$(date -u +%Y%m%dT%H%M%SZ)}

resolved=$(.venv/bin/qswarm check "$scenario")
agents=$("$python" -c '
import sys, tomllib
print(tomllib.load(sys.stdin.buffer)["fleet"]["agents"])' <<<"$resolved")

pids=()
trap 'kill "${pids[@]}" 2>/dev/null || true; wait' EXIT

# The others start after netem listens: at a port in use they would reach another netem.
exec {netem}< <(exec "$python" -m netem --listen "$endpoint")
pids+=($!)
read -r line <&"$netem" || exit 2
echo "$line"
cat <&"$netem" &
exec {netem}<&-
"$python" -m worldsim "$scenario" --connect "$endpoint" --run "$run" --out "$out" &
world=$!
pids+=("$world")
for ((id = 0; id < agents; id++)); do
    "$python" -m agent --id "$id" --run "$run" --connect "$endpoint" &
    pids+=($!)
done

status=0
wait "$world" || status=$?
if [[ $status != 2 && -f $out/summary.json ]]; then
    "$python" -c '
import json, sys
print("outcome:", json.load(open(sys.argv[1]))["outcome"])' "$out/summary.json"
    echo "kept in $out"
fi
exit "$status"
