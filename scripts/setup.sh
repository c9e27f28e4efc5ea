#!/usr/bin/env bash
# Make this machine ready: Debian packages (through apt when it may), then the virtual environment.
# Quick when nothing is missing. Never asks; what it may not do it prints as a command.
set -euo pipefail
cd "$(dirname "$0")/.."

VENV=.venv
STAMP=$VENV/.setup.stamp
EXTRAS=gl,transport,s3,workers,selection,board,dev

has_lib() { PATH=$PATH:/sbin:/usr/sbin ldconfig -p | grep -q "$1"; }

missing_packages() {
  local p
  has_lib 'libLLVM\(-19\.so\|\.so\.19\|-20\.so\|\.so\.2[0-9]\|-1[78]\.so\|\.so\.18\)' || echo libllvm19
  has_lib 'libatomic\.so\.1' || echo libatomic1
  has_lib 'libEGL\.so\.1' || echo libegl1
  has_lib 'libGL\.so\.1' || echo libgl1
  has_lib 'libEGL_mesa\.so\.0' || [ -e /proc/driver/nvidia ] || echo libegl-mesa0
  compgen -G '/usr/lib/*/dri/swrast_dri.so' >/dev/null || compgen -G '/usr/lib/*/libgallium*.so' >/dev/null || [ -e /proc/driver/nvidia ] || echo libgl1-mesa-dri
  # Fonts for names in other scripts on sheets: DejaVu Sans, and Droid Sans Fallback for Chinese, Japanese and Korean.
  [ -e /usr/share/fonts/truetype/dejavu/DejaVuSans.ttf ] || echo fonts-dejavu-core
  [ -e /usr/share/fonts/truetype/droid/DroidSansFallbackFull.ttf ] || echo fonts-droid-fallback
  command -v redis-server >/dev/null || echo redis-server
  # Commands that a target of the Makefile wants beside the usual ones: COMMAND:PACKAGE, or a name that is both.
  for p in ${PBRS_SETUP_ALSO:-}; do command -v "${p%%:*}" >/dev/null || echo "${p##*:}"; done
  [ -n "$(find_python)" ] || echo python3
  [ -x "$VENV/bin/python" ] || "$(find_python || echo false)" -c 'import ensurepip' 2>/dev/null || echo python3-venv
}

find_python() {
  local p
  for p in "${PYTHON:-}" python3 python3.13 python3.12 python3.11; do
    [ -n "$p" ] && command -v "$p" >/dev/null || continue
    if "$p" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then
      command -v "$p"
      return 0
    fi
  done
  return 0
}

install_packages() {
  local sudo=""
  if ! command -v apt-get >/dev/null; then
    echo "setup: not a Debian machine; please install the equivalents of: $*" >&2
    return 0
  fi
  if [ "$(id -u)" != 0 ]; then
    if command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
      sudo=sudo
    else
      echo "setup: missing packages; please run:" >&2
      echo "    sudo apt-get update && sudo apt-get install -y --no-install-recommends $*" >&2
      return 0
    fi
  fi
  echo "setup: installing $* with apt"
  # policy-rc.d keeps apt from starting a Redis service: the tests start their own.
  $sudo env DEBIAN_FRONTEND=noninteractive apt-get update -qq || echo "setup: apt-get update failed; trying with the lists as they are" >&2
  $sudo env DEBIAN_FRONTEND=noninteractive RUNLEVEL=1 apt-get install -y -qq --no-install-recommends "$@" >/dev/null ||
    echo "setup: apt could not install: $*" >&2
}

main() {
  local packages python want
  mapfile -t packages < <(missing_packages)
  if [ ${#packages[@]} -gt 0 ]; then
    install_packages "${packages[@]}"
  fi

  want=$( (cat pyproject.toml scripts/setup.sh; echo $EXTRAS) | sha256sum | cut -d' ' -f1)
  if [ -x $VENV/bin/pbrs-farm ] && [ "$(cat $STAMP 2>/dev/null)" = "$want" ]; then
    return 0
  fi
  python=$(find_python)
  if [ -z "$python" ]; then
    echo "setup: Python 3.11 or later is needed: sudo apt-get install -y python3 python3-venv" >&2
    exit 1
  fi
  echo "setup: virtual environment $VENV with $($python --version) (some minutes the first time)"
  [ -x $VENV/bin/python ] || "$python" -m venv $VENV || {
    echo "setup: no venv module: sudo apt-get install -y python3-venv" >&2
    exit 1
  }
  $VENV/bin/python -m pip install -q --disable-pip-version-check -e ".[$EXTRAS]" 2>&1 |
    { grep -vE '^\s|^$|WARNING' || true; } >&2
  [ "${PIPESTATUS[0]}" = 0 ] || exit 1
  echo "$want" >$STAMP
  echo "setup: done"
}

main
