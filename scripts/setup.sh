#!/usr/bin/env bash
# Make this machine ready: system packages (Debian and Ubuntu through apt when it may), then the virtual
# environment. Quick when nothing is missing. Never asks; what it may not do it prints as a command.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

VENV=.venv
STAMP=$VENV/.setup.stamp
LOG=$VENV/setup.log
EXTRAS=s3,workers,selection,video,physics,usd,ifc,gltf,dev

has_lib() { PATH=$PATH:/sbin:/usr/sbin ldconfig -p 2>/dev/null | grep -q "$1"; }

# debian, ubuntu, fedora, arch, macos, or other; OS_RELEASE: the file that says so.
system() {
  local word
  [ "$(uname)" != Darwin ] || { echo macos; return; }
  # shellcheck source=/dev/null
  for word in $(. "${OS_RELEASE:-/etc/os-release}" 2>/dev/null && echo "${ID:-} ${ID_LIKE:-}"); do
    case $word in
      debian | ubuntu | fedora | arch) echo "$word"; return ;;
      rhel | centos) echo fedora; return ;;
    esac
  done
  echo other
}

# The command that installs, on this system, what Debian calls so.
command_for() {
  local p names=() installer
  case $(system) in
    debian | ubuntu) installer="sudo apt-get update && sudo apt-get install -y --no-install-recommends" ;;
    fedora) installer="sudo dnf install -y" ;;
    arch) installer="sudo pacman -S --needed" ;;
    macos) installer="brew install" ;;
    *) echo "(no package manager known here: install the equivalents of $*)"; return ;;
  esac
  for p in "$@"; do names+=("$(name_for "$p")"); done
  echo "$installer" $(printf '%s\n' "${names[@]}" | tr ' ' '\n' | sort -u)
}

# What a Debian package is called on this system; nothing where the system brings it.
name_for() {
  case $(system):$1 in
    ubuntu:libllvm19) echo libllvm18 ;;
    fedora:libllvm19) echo llvm-libs ;;
    fedora:libatomic1) echo libatomic ;;
    fedora:libegl1 | fedora:libegl-mesa0) echo mesa-libEGL ;;
    fedora:libgl1) echo mesa-libGL ;;
    fedora:libgl1-mesa-dri) echo mesa-dri-drivers ;;
    fedora:fonts-dejavu-core) echo dejavu-sans-fonts ;;
    fedora:fonts-droid-fallback) echo google-droid-sans-fonts ;;
    fedora:redis-server | arch:redis-server) echo valkey ;;
    fedora:python3-venv) echo python3 ;;
    arch:libllvm19) echo llvm-libs ;;
    arch:libatomic1) echo gcc-libs ;;
    arch:libegl* | arch:libgl*) echo mesa libglvnd ;;
    arch:fonts-dejavu-core) echo ttf-dejavu ;;
    arch:fonts-droid-fallback) echo ttf-droid ;;
    arch:python3*) echo python ;;
    macos:libllvm19) echo llvm ;;
    macos:redis-server) echo redis ;;
    macos:python3*) echo python@3.12 ;;
    macos:lib* | macos:fonts-*) ;;
    *) echo "$1" ;;
  esac
}

has_llvm() { has_lib 'libLLVM\(-19\.so\|\.so\.19\|-20\.so\|\.so\.2[0-9]\|-1[78]\.so\|\.so\.18\)'; }

# What pip installs: LLVM too where the system has none, since who has no root cannot add it (Linux on x86-64).
extras() {
  has_llvm || printf 'llvm,'
  echo "$EXTRAS"
}

missing_packages() {
  local p
  has_llvm || echo libllvm19
  has_lib 'libatomic\.so\.1' || echo libatomic1
  [ "$(uname)" != Darwin ] || { missing_on_macos; return; }
  has_lib 'libEGL\.so\.1' || echo libegl1
  has_lib 'libGL\.so\.1' || echo libgl1
  [ "$(uname)" != Darwin ] || { missing_on_macos; return; }
  has_lib 'libEGL_mesa\.so\.0' || [ -e /proc/driver/nvidia ] || echo libegl-mesa0
  compgen -G '/usr/lib*/*/dri/swrast_dri.so' >/dev/null || compgen -G '/usr/lib*/dri/swrast_dri.so' >/dev/null ||
    compgen -G '/usr/lib/*/libgallium*.so' >/dev/null || compgen -G '/usr/lib*/libgallium*.so' >/dev/null || [ -e /proc/driver/nvidia ] || echo libgl1-mesa-dri
  # Fonts for names in other scripts on sheets: DejaVu Sans, and Droid Sans Fallback for Chinese, Japanese and Korean.
  has_font DejaVuSans.ttf || echo fonts-dejavu-core
  has_font 'DroidSansFallback*.ttf' || echo fonts-droid-fallback
  command -v redis-server >/dev/null || echo redis-server
  # Commands that a target of the Makefile wants beside the usual ones: COMMAND:PACKAGE, or a name that is both.
  for p in ${PBRS_SETUP_ALSO:-}; do command -v "${p%%:*}" >/dev/null || echo "${p##*:}"; done
  [ -n "$(find_python)" ] || echo python3
  [ -x "$VENV/bin/python" ] || "$(find_python || echo false)" -c 'import ensurepip' 2>/dev/null || echo python3-venv
}

has_font() { [ -n "$(find /usr/share/fonts -name "$1" -print -quit 2>/dev/null)" ]; }

missing_on_macos() {
  compgen -G '/opt/homebrew/opt/llvm*/lib/libLLVM*.dylib' >/dev/null || compgen -G '/usr/local/opt/llvm*/lib/libLLVM*.dylib' >/dev/null || echo libllvm19
  command -v redis-server >/dev/null || echo redis-server
  [ -n "$(find_python)" ] || echo python3
}

find_python() {
  local p
  for p in "${PYTHON:-}" python3 python3.14 python3.13 python3.12 python3.11; do
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
    echo "setup: missing packages; please run:" >&2
    echo "    $(command_for "$@")" >&2
    return 0
  fi
  if [ "$(id -u)" != 0 ]; then
    if command -v sudo >/dev/null && sudo -n true 2>/dev/null; then
      sudo=sudo
    else
      echo "setup: missing packages; please run:" >&2
      echo "    $(command_for "$@")" >&2
      return 0
    fi
  fi
  echo "setup: installing $* with apt (a minute or two)"
  # policy-rc.d keeps apt from starting a Redis service: the tests start their own.
  $sudo env DEBIAN_FRONTEND=noninteractive apt-get update -qq || echo "setup: apt-get update failed; trying with the lists as they are" >&2
  $sudo env DEBIAN_FRONTEND=noninteractive RUNLEVEL=1 apt-get install -y -qq --no-install-recommends "$@" >/dev/null ||
    echo "setup: apt could not install: $*" >&2
}

# What pip is at, of its lines: on a terminal one line that is rewritten, elsewhere a line for each 20 packages.
told_of_pip() {
  local line at='' n=0 told=0
  while IFS= read -r line; do
    case $line in
      Collecting\ *) n=$((n + 1)) at="looking up ${line#Collecting }" ;;
      *Downloading\ *whl\ * | *Downloading\ *gz\ *) at="downloading ${line#*Downloading }" ;;
      Building\ * | *Building\ wheel*) at="building" ;;
      Installing\ collected\ *) at="unpacking all of them" told=-20 ;;
      *) continue ;;
    esac
    if [ -t 2 ]; then
      printf '\r\033[Ksetup: %s packages, %s s: %.60s' $n $SECONDS "$at"
    elif [ $((n - told)) -ge 20 ]; then
      echo "setup: $n packages, $SECONDS s: $at"
      told=$n
    fi
  done
  [ ! -t 2 ] || printf '\r\033[K'
}

main() {
  local packages python want
  # Not mapfile: macOS has a bash of 2007.
  packages=$(missing_packages)
  if [ -n "$packages" ]; then
    # shellcheck disable=SC2086
    install_packages $packages
  fi

  want=$(cat pyproject.toml setup.py scripts/setup.sh | cksum)
  if [ -x $VENV/bin/pbrs-farm ] && [ "$(cat $STAMP 2>/dev/null)" = "$want" ]; then
    return 0
  fi
  python=$(find_python)
  if [ -z "$python" ]; then
    echo "setup: Python 3.11 or later is needed: $(command_for python3 python3-venv)" >&2
    exit 1
  fi
  echo "setup: virtual environment $VENV with $($python --version): some minutes and a gigabyte the first time"
  [ -x $VENV/bin/python ] || "$python" -m venv $VENV || {
    echo "setup: no venv module: $(command_for python3-venv)" >&2
    exit 1
  }
  if ! PYTHONUNBUFFERED=1 $VENV/bin/python -m pip install --disable-pip-version-check --no-input --progress-bar off --no-compile \
    -e ".[$(extras)]" 2>&1 | tee $LOG | told_of_pip >&2; then
    tail -n 20 $LOG >&2
    echo "setup: pip failed; all that it said: $LOG" >&2
    exit 1
  fi
  echo "$want" >$STAMP
  echo "setup: done"
}

[ "${BASH_SOURCE[0]}" != "$0" ] || main
