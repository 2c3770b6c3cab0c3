# Sourced by demo, test, docs and lint with `kind` set to run, dev or lint: brings .venv to what the locks say.
# Needs Python 3.11 or newer with venv and pip; PYTHON=... chooses which.
set -eu
root=$(CDPATH='' cd -- "$(dirname -- "$0")/.." && pwd)
cd "$root"

fits='import sys; sys.exit(sys.version_info < (3, 11))'
whole='import ensurepip, venv'

find_python() { # prints the first Python that will do, or says why there is none
    set -- python3 python3.15 python3.14 python3.13 python3.12 python3.11 python
    if [ -n "${PYTHON:-}" ]; then set -- "$PYTHON"; fi
    for candidate; do
        version=$("$candidate" --version 2>&1) || continue # Python 2 says it on stderr
        if ! "$candidate" -c "$fits" 2>/dev/null; then
            seen="${seen:-}, $candidate is $version"
        elif ! "$candidate" -c "$whole" 2>/dev/null; then
            seen="${seen:-}, $candidate ($version) has no venv (Debian: apt install python3-venv)"
        else
            echo "$candidate"
            return
        fi
    done
    none=${PYTHON:+, $PYTHON does not start}
    seen=${seen:-${none:-, none was found}}
    echo "fivebar-sim needs Python 3.11 or newer with venv$seen; set PYTHON to one" >&2
    return 1
}

# The set-up compiles nothing: what is imported is compiled at its first import, and kept even where the environment
# forbids that. Each of the hundreds of Pythons that the tests start, and each pytest, would compile it all anew.
unset PYTHONDONTWRITEBYTECODE

python=$(find_python)
"$python" scripts/make_env.py "$kind"
