# Sourced by demo and test: makes .venv with exactly what requirements.lock pins, once per lock.
# Needs Python 3.11 or newer with pip and venv; PYTHON=... chooses which.
set -eu
root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
cd "$root"

find_python() {
    for candidate in ${PYTHON:-} python3 python3.13 python3.12 python3.11 python; do
        if "$candidate" -c 'import sys, venv; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
            echo "$candidate"
            return
        fi
    done
    echo "fivebar-sim needs Python 3.11 or newer with venv; set PYTHON to its path" >&2
    exit 1
}

wanted="$(cat requirements.lock pyproject.toml | cksum) $root"
if [ "$(cat .venv/installed 2>/dev/null || true)" != "$wanted" ]; then
    python=$(find_python)
    echo "Setting up .venv with $("$python" --version) ..."
    "$python" -m venv --clear .venv
    .venv/bin/python -m pip install --quiet --disable-pip-version-check --require-hashes \
        -r requirements.lock
    .venv/bin/python -m pip install --quiet --disable-pip-version-check --no-deps \
        --no-build-isolation --editable .
    echo "$wanted" > .venv/installed
fi
