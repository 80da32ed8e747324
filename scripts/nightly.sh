#!/bin/sh
# What is too long for every commit: slow tests, a thousand mutants, kills, the lowest versions, known vulnerabilities.
# Needs labsim[dev,cluster] and uv in the running environment; some fault tests need the right to mount a tmpfs.
set -u
status=0
run() { echo "== $*"; "$@" || status=1; }

run python -m pytest -q -m slow
run env LABSIM_MUTANTS=1000 python -m pytest -q -s tests/faults/test_mutants.py
for command in simulate calibrate track ct; do
  run python benchmarks/kill_and_resume.py "$command" --kills 10 --seed "$(date +%j)"
done

scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
if uv pip compile -q --resolution lowest-direct --extra test --extra cluster pyproject.toml -o "$scratch/lowest.txt" &&
  uv venv -q "$scratch/venv" && uv pip install -q -p "$scratch/venv/bin/python" -r "$scratch/lowest.txt"; then
  run env PYTHONPATH=. "$scratch/venv/bin/python" -m pytest -q -W ignore tests/test_campaign.py tests/cli tests/inference tests/video tests/ct
else
  status=1
fi
run python -m pip_audit -r "$scratch/lowest.txt" --no-deps --disable-pip
exit $status
