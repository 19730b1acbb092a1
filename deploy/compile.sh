#!/usr/bin/env bash
# Compiles what is hot, so that everything runs faster with the same result:
#
#     deploy/compile.sh
#
# It needs a C compiler, and takes a minute or two. Compiled code runs from then on, until a source
# file changes. QSWARM_PURE=1 runs pure Python; removing build/compiled does so for good.
set -euo pipefail
here=$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)
# shellcheck source=deploy/setup.sh
source "$here/setup.sh"

command -v "${CC:-cc}" >/dev/null \
    || fail "there is no C compiler '${CC:-cc}'; on Debian and Ubuntu: apt-get install gcc"
set_up dev
cd "$root"
mkdir -p build
say "compiling; a line of progress for each file is in build/compile.log ..."
QSWARM_PURE=1 "$venv/bin/python" setup.py --quiet compile >build/compile.log 2>&1 \
    || { tail -n 20 build/compile.log >&2; fail "compiling failed; pure Python runs as before"; }
say "compiled in $SECONDS s"
