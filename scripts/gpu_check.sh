#!/usr/bin/env bash
# From a bare machine with an NVIDIA driver to a table of what it does here: every test marked gpu, then light,
# denoiser, OpenGL, two slots on a card, a home of 4 million triangles and the study's trainer (where torch is). Writes
# out/bench/gpu_tests.txt and out/bench/gpu.json, and copies them into $OUT where that is set.
#
#   scripts/gpu_check.sh                            fetches the libraries with pip
#   scripts/gpu_check.sh FOLDER                     takes them from a folder: no network, no pip, no xz
#   scripts/gpu_check.sh --only tests [FOLDER]      the first half: ends within 300 seconds, whatever happens
#   scripts/gpu_check.sh --only views [FOLDER]      the second half: within 300 seconds, too
#   scripts/gpu_check.sh --wheels FOLDER [VERSION]  makes the folder for a version of Python, where there is a network
#
# The folder's wheels-VERSION.tar.xz (60 MB) holds the libraries of the published wheels as cut copies, for this check
# only: gpu_wheels.txt says which files are left out because nothing here opens them, gpu_wheels.py what is blanked in
# the others (debug data, and the networks of Open Image Denoise that pbrs_farm does not ask for), CUT.txt in the
# archive in which. Take libraries for anything else from the wheels. PYTHON names the interpreter; else it is the first of
# python3 and python3.11 to python3.14 that the folder has an archive for.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

VENV=${VENV:-out/gpu-venv}
PATH=$PATH:/usr/sbin:/sbin

fail() {
  echo "gpu_check: $2" >&2
  exit "$1"
}

LIMIT_S=285 # of a half; a call of 300 seconds holds it

# The file that a half of the check leaves.
figures_of() {
  case $1 in
    tests) echo out/bench/gpu_tests.txt ;;
    views) echo out/bench/gpu.json ;;
  esac
}

# Run a half within some seconds. All that pytest says goes to its file; a screen of it is printed.
half_of() {
  local status=0
  case $1 in
    tests)
      timeout "$2" "$VENV/bin/python" -m pytest -q -m gpu tests/transport tests/workers/node -rA --durations=5 \
        >"$(figures_of tests)" 2>&1 || status=$?
      grep -E '^(FAILED|ERROR|E  )' "$(figures_of tests)" | cut -c -200 | head -n 20 || true
      tail -n 1 "$(figures_of tests)"
      ;;
    views) timeout "$2" "$VENV/bin/python" -m benchmarks gpu || status=$? ;;
  esac
  [ "$status" != 124 ] || echo "gpu_check: $1 took more than $2 s" >&2
  return "$status"
}

if [ "${1:-}" = --wheels ]; then
  [ -n "${2:-}" ] || fail 2 "--wheels wants a folder to write to"
  exec "${PYTHON:-python3}" scripts/gpu_wheels.py "${@:2}"
fi

halves="tests views"
if [ "${1:-}" = --only ]; then
  case ${2:-} in
    tests | views) halves=$2 ;;
    *) fail 2 "--only wants tests or views" ;;
  esac
  shift 2
fi

# An interpreter that the folder has an archive for; any will do where pip fetches.
python=
for candidate in ${PYTHON:-python3 python3.11 python3.12 python3.13 python3.14}; do
  version=$("$candidate" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null) || continue
  if [ -z "${1:-}" ] || [ -f "$1/wheels-$version.tar.xz" ]; then
    python=$candidate
    break
  fi
done
if [ -z "$python" ]; then
  archives=$(cd "${1:-.}" 2>/dev/null && ls -d wheels-*.tar.xz 2>/dev/null | xargs || true)
  here=$(${PYTHON:-python3} -V 2>&1 || true)
  fail 1 "${1:-.} holds ${archives:-nothing}, here is $here; scripts/gpu_check.sh --wheels FOLDER VERSION packs for another version"
fi

# The driver first: without it everything below would run on the CPU and say nothing.
nvidia-smi --query-gpu=name,driver_version,memory.total --format=csv,noheader 2>/dev/null ||
  fail 1 "no NVIDIA GPU here: nvidia-smi is missing or finds none; make test-cuda checks the kernels without one"
for library in libnvoptix.so.1 libGL.so.1 libEGL.so.1 libEGL_nvidia.so.0; do
  ldconfig -p | grep -q "$library" || echo "gpu_check: no $library here: light needs libnvoptix, OpenGL the others (Debian: libgl1 libegl1)" >&2
done

if [ -n "${1:-}" ]; then
  [ -x "$VENV/bin/python" ] || "$python" -m venv --without-pip "$VENV"
  # Python unpacks them: a bare machine may have no xz.
  "$VENV/bin/python" -W ignore - "$1/wheels-$version.tar.xz" <<'UNPACK'
import sys, sysconfig, tarfile

with tarfile.open(sys.argv[1]) as tar:
    tar.extractall(sysconfig.get_path("purelib"))
UNPACK
else
  [ -x "$VENV/bin/python" ] || "$python" -m venv "$VENV"
  "$VENV/bin/pip" install -q ".[workers]" pytest hypothesis
fi

mkdir -p out/bench
rm -f $(for half in $halves; do figures_of "$half"; done)
status=0
began=0 # the first half's clock runs from the start of this script: making the environment counts
for half in $halves; do
  left=$((LIMIT_S + began - SECONDS))
  [ "$left" -gt 0 ] || fail 1 "the environment took $SECONDS s; it is there now: try again"
  half_of "$half" "$left" || status=$?
  began=$SECONDS
done
if [ -n "${OUT:-}" ]; then
  mkdir -p "$OUT"
  for half in $halves; do cp -f "$(figures_of "$half")" "$OUT" 2>/dev/null || true; done
fi
exit "$status"
