#!/usr/bin/env bash
# Run the tests with the lowest (oldest) or highest (newest) versions that pyproject.toml allows, on the oldest or newest
# Python here, in an environment of its own: test_versions.sh oldest|newest MARKS [tests]. uv chooses the versions, since pip
# has no such option. Old versions warn of changes in newer ones, so warnings are no errors.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

age=$1 marks=$2
shift 2
case $age in
  oldest) pythons="python3.11 python3.12 python3.13 python3.14 python3" resolution=lowest-direct ;;
  newest) pythons="python3.14 python3.13 python3.12 python3.11 python3" resolution=highest ;;
esac
venv=out/$age-venv
for python in $pythons; do
  ! "$python" -c 'import ensurepip' 2>/dev/null || break
done
[ -x "$venv/bin/python" ] || "$python" -m venv "$venv"
"$venv/bin/python" -m pip install -q --disable-pip-version-check uv
# shellcheck source=scripts/setup.sh
. scripts/setup.sh
"$venv/bin/uv" pip install -q --upgrade --python "$venv/bin/python" --resolution $resolution -e ".[$(extras)]"
"$venv/bin/uv" pip freeze --python "$venv/bin/python" >"out/$age-versions.txt"
"$venv/bin/python" -m pytest -n 2 --dist worksteal -W default -m "$marks" "$@"
