#!/usr/bin/env bash
# From a bare machine with an NVIDIA driver to a table of what it does here: every test marked gpu, then views
# an hour, under ten minutes. `scripts/gpu_check.sh [WHEELS]`: a folder of wheels for machines without a network,
# as `scripts/gpu_check.sh --wheels FOLDER` makes one where there is one: 293 MB, in pieces of 60 MB that can be
# carried one by one; PYTHON names the interpreter, of one version on both. Writes out/bench/gpu.json.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

VENV=${VENV:-out/gpu-venv}
PACKAGES=".[gl,transport] pytest hypothesis"

if [ "${1:-}" = --wheels ]; then
  [ -n "${2:-}" ] || {
    echo "gpu_check: --wheels wants a folder to write to" >&2
    exit 2
  }
  wheels=$(mktemp -d)
  trap 'rm -rf "$wheels"' EXIT
  "${PYTHON:-python3}" -c 'import sys; print(*sys.version_info[:2], sep=".")' >"$wheels/python"
  # shellcheck disable=SC2086
  "${PYTHON:-python3}" -m pip wheel -q --wheel-dir "$wheels" $PACKAGES setuptools
  mkdir -p "$2"
  rm -f "$2"/wheels.tar.*
  tar -C "$wheels" -c . | split -b 60MB - "$2/wheels.tar."
  du -ch --apparent-size "$2"/wheels.tar.*
  exit 0
fi

if [ -n "${1:-}" ] && ! ls "$1"/wheels.tar.* >/dev/null 2>&1; then
  echo "gpu_check: $1 has no wheels.tar.* (scripts/gpu_check.sh --wheels FOLDER makes them)" >&2
  exit 2
fi

# The driver first: without it everything below would run on the CPU and say nothing.
nvidia-smi --query-gpu=name,driver_version,memory.total --format=csv,noheader || {
  echo "gpu_check: no NVIDIA driver here (nvidia-smi fails)" >&2
  exit 1
}
for library in libnvoptix.so.1 libEGL_nvidia.so.0; do
  ldconfig -p | grep -q "$library" || echo "gpu_check: the driver lacks $library: light needs OptiX, OpenGL needs EGL" >&2
done

[ -x "$VENV/bin/python" ] || "${PYTHON:-python3}" -m venv "$VENV"
if [ -n "${1:-}" ]; then
  wheels=$(mktemp -d)
  trap 'rm -rf "$wheels"' EXIT
  cat "$1"/wheels.tar.* | tar -C "$wheels" -x
  "$VENV/bin/python" -c 'import sys; sys.exit(sys.argv[1] != "%d.%d" % sys.version_info[:2])' "$(cat "$wheels/python")" || {
    echo "gpu_check: $1 is for Python $(cat "$wheels/python"), here is $("$VENV/bin/python" -V); PYTHON=... names another" >&2
    exit 1
  }
  # shellcheck disable=SC2086
  "$VENV/bin/pip" install -q --no-index --find-links "$wheels" $PACKAGES
else
  # shellcheck disable=SC2086
  "$VENV/bin/pip" install -q $PACKAGES
fi

status=0
timeout 300 "$VENV/bin/python" -m pytest -m gpu tests/transport -rA || status=$?
timeout 240 "$VENV/bin/python" -m benchmarks gpu || status=$?
exit "$status"
