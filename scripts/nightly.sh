#!/bin/sh
# What is too long for every commit: slow tests, a thousand mutants, kills, the lowest versions, known vulnerabilities.
# Run it from anywhere with the environment's python first in PATH: pip install -e ".[dev,cluster]" uv pip-audit
# Some fault tests need the right to mount a tmpfs. NIGHTLY names the parts to run; all without it:
#   NIGHTLY="versions audit" scripts/nightly.sh
set -u
cd "$(dirname "$0")/.." || exit 1
python -c "import labsim, pytest, uv, pip_audit" || {
  echo "error: python: lacks what the night needs; pip install -e '.[dev,cluster]' uv pip-audit, and put that python first in PATH" >&2
  exit 2
}
parts=${NIGHTLY:-slow mutants kills versions audit}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
failed=""
run() {
  echo "== $*"
  "$@" || failed="$failed
  $*"
}

# the lowest versions that pyproject.toml allows, in an environment of their own
try_lowest_versions() {
  run python -m uv pip compile -q --resolution lowest-direct --extra test --extra cluster pyproject.toml -o "$scratch/lowest.txt"
  [ -s "$scratch/lowest.txt" ] || return
  run python -m uv venv -q "$scratch/venv"
  run python -m uv pip install -q -p "$scratch/venv/bin/python" -r "$scratch/lowest.txt"
  run env PYTHONPATH=. "$scratch/venv/bin/python" -m pytest -q -W ignore tests/test_campaign.py tests/cli tests/inference tests/video tests/ct
}

for part in $parts; do
  case $part in
    slow) run python -m pytest -q -n 2 -m slow ;;
    mutants) run env LABSIM_MUTANTS=1000 python -m pytest -q -s tests/faults/test_mutants.py ;;
    kills)
      for command in simulate calibrate diagnose track ct; do
        run python -m benchmarks.faults.kill_and_resume "$command" --kills 10 --seed "$(date +%j)"
      done
      ;;
    versions) try_lowest_versions ;;
    audit)
      python -m uv pip freeze -q --exclude-editable | grep -v "^labsim" > "$scratch/installed.txt"
      # strict: a package that could not be looked up is a failure, not a pass
      run python -m pip_audit -r "$scratch/installed.txt" --no-deps --disable-pip --strict
      ;;
    *) echo "error: NIGHTLY: $part is no part; use slow, mutants, kills, versions, audit" >&2; exit 2 ;;
  esac
done
[ -z "$failed" ] || { echo "failed:$failed"; exit 1; }
