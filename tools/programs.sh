# What the checkout needs of the machine; sourced by the scripts of this folder.
# Sets `root` (the checkout) and defines: die, python_program, java_program, missing_packages, install_locked.

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
sbt_version=1.12.14
sbt_launcher="$root/.tools/sbt-launch-$sbt_version.jar"
sbt_launcher_sha256=1750c8fb61c2d2f82da40b2cd9014f4d8a1bd49a361402ea5b1cec061ed66578

# An unset or unusable HOME must not send caches to the file system's root. Java asks the system, not HOME.
java_home_option=()
if [ -z "${HOME:-}" ] || [ ! -d "$HOME" ]; then
  HOME="$(getent passwd "$(id -u)" 2>/dev/null | cut -d: -f6)"
  if [ -z "$HOME" ] || [ ! -w "$HOME" ]; then
    HOME="$root/.cache/home"
    mkdir -p "$HOME"
    java_home_option=("-Duser.home=$HOME")
  fi
  export HOME
fi

die() {
  echo "colonnade: error: $*" >&2
  exit 2
}

has() { command -v "$1" >/dev/null 2>&1; }

python_is_new_enough() { "$1" -c 'import sys; sys.exit(sys.version_info < (3, 10))' >/dev/null 2>&1; }

# The interpreter for .venv: the first of these that is Python 3.10 or newer.
python_program() {
  local candidate
  for candidate in "${PYTHON:-python3}" python3 python3.13 python3.12 python3.11 python3.10 /usr/bin/python3; do
    if has "$candidate" && python_is_new_enough "$candidate"; then
      echo "$candidate"
      return
    fi
  done
}

# Python can make environments and compile extensions against its own headers.
python_is_complete() {
  "$1" -c '
import ensurepip, os, sys, sysconfig, venv
sys.exit(not os.path.exists(os.path.join(sysconfig.get_paths()["include"], "Python.h")))' >/dev/null 2>&1
}

java_program() {
  if [ -n "${JAVA_HOME:-}" ] && [ -x "$JAVA_HOME/bin/java" ]; then echo "$JAVA_HOME/bin/java"; else command -v java || true; fi
}

java_is_new_enough() {
  local java version
  java="$(java_program)"
  [ -n "$java" ] || return 1
  version="$("$java" -version 2>&1 | sed -nE 's/.*version "([0-9]+).*/\1/p' | head -n 1)"
  [ -n "$version" ] && [ "$version" -ge 17 ]
}

sha256_matches() { [ -f "$1" ] && [ "$(sha256sum "$1" | cut -d' ' -f1)" = "$2" ]; }

# The Debian packages whose programs are missing, one line, space separated.
missing_packages() {
  local missing=() python
  java_is_new_enough || missing+=(openjdk-17-jdk-headless)
  has verilator || missing+=(verilator)
  has g++ || missing+=(g++)
  has make || missing+=(make)
  has z3 || missing+=(z3)
  # Maven only fetches the sbt launcher: not needed where sbt or the launcher is there already.
  has sbt || has mvn || sha256_matches "$sbt_launcher" "$sbt_launcher_sha256" || missing+=(maven)
  python="$(python_program)"
  if [ -z "$python" ] || ! python_is_complete "$python"; then missing+=(python3 python3-venv python3-dev); fi
  echo "${missing[*]}"
}

# Installs a lock of host/locks into an environment; pip refuses every file whose hash the lock does not name.
# Usage: install_locked ENVIRONMENT LOCK [OPTION OF PIP]…
install_locked() {
  local environment="$1" lock="$2" log="$root/.cache/pip-$2.log" different
  shift 2
  mkdir -p "$root/.cache"
  PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1 "$environment/bin/python" -m pip install --no-deps --require-hashes "$@" \
    -r "$root/host/locks/$lock.txt" >"$log" 2>&1 </dev/null && return
  # pip names the package in the line below its warning, then the hash that it got.
  different="$(awk '/DO NOT MATCH THE HASHES/ { getline; sub(/^ */, ""); sub(/ from .*/, ""); print; exit }' "$log")"
  [ -z "$different" ] || die "$different is not the file that host/locks/$lock.txt holds by its SHA-256; nothing was installed of it: see $log"
  tail -n 20 "$log" >&2
  die "installing the packages of host/locks/$lock.txt failed: see $log"
}
