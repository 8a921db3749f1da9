# Required programs and common functions; the scripts of this folder source this file.
# Sets `root` (the checkout) and defines: die, python_program, java_program, missing_packages, install_locked.

# -h and --help of a script print the comment at its head.
case "${1:-}" in
  -h | --help) sed -n '1d; /^#/!q; s/^# \{0,1\}//p' "$0" && exit ;;
esac

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
sbt_version=1.12.14
sbt_launcher="$root/.tools/sbt-launch-$sbt_version.jar"
sbt_launcher_sha256=1750c8fb61c2d2f82da40b2cd9014f4d8a1bd49a361402ea5b1cec061ed66578
sbt_boot="$root/.cache/sbt-boot-$sbt_version" # sbt itself, as the launcher fetches it
uv="$root/.venv/bin/uv"

# Minimum versions. Verilator: the oldest that the tests ran with; keep
# host/colonnade/{design/toolchain,device/compiler}.py equal.
minimum_verilator=5.006
minimum_gxx=10
minimum_make=4.0
minimum_java=17
minimum_python=3.10

# Without a usable HOME, caches must not go to the root of the file system. Java ignores HOME.
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

# Java, CMake and make interpret these characters in a path as separators, quotes or commands.
case "$root" in
  *[:\;\"\'\`\#\$\\\&\|\<\>\(\)\*\?]*) die "the path of the checkout, $root, has a character that Java or CMake does not accept; move the checkout" ;;
esac

# The arguments as one text, with semicolons between them.
joined() { printf '%s; ' "$@" | sed 's/; $//'; }

has() { command -v "$1" >/dev/null 2>&1; }

# Whether version $1 is $2 or newer.
at_least() { [ "$(printf '%s\n%s\n' "$2" "$1" | sort -V | head -n 1)" = "$2" ]; }

# The interpreter for .venv: the first candidate that is Python 3.10, or $1, or newer.
python_program() {
  local candidate
  for candidate in "${PYTHON:-python3}" python3 python3.13 python3.12 python3.11 python3.10 /usr/bin/python3; do
    if has "$candidate" && at_least "$(python_version "$candidate")" "${1:-$minimum_python}"; then
      echo "$candidate"
      return
    fi
  done
}

# Whether Python can create environments and has its headers for compiling extensions.
python_is_complete() {
  "$1" -c '
import ensurepip, os, sys, sysconfig, venv
sys.exit(not os.path.exists(os.path.join(sysconfig.get_paths()["include"], "Python.h")))' >/dev/null 2>&1
}

# Sets `pythons` to the interpreters that compile the wheels of a release, one for each module that a wheel holds: for
# 3.10, for 3.11, and for all later ones. Adds what is missing for a release to `lacks`.
release_needs() {
  local names name found changes
  changes="$(git -C "$root" status --porcelain)"
  [ -z "$changes" ] || lacks+=("a commit of what git status lists, such as ${changes%%$'\n'*}")
  pythons=()
  for names in python3.10 python3.11 "python3.12 python3.13 python3.14"; do
    found=""
    for name in $names; do
      [ -n "$found" ] || ! python_is_complete "$name" || found="$(command -v "$name")"
    done
    if [ -n "$found" ]; then pythons+=("$found"); else lacks+=("${names// / or } on PATH with its headers and ensurepip"); fi
  done
}

java_program() {
  if [ -n "${JAVA_HOME:-}" ] && [ -x "$JAVA_HOME/bin/java" ]; then echo "$JAVA_HOME/bin/java"; else command -v java || true; fi
}

java_is_new_enough() {
  local java version
  java="$(java_program)"
  [ -n "$java" ] || return 1
  version="$(java_version "$java")"
  [ -n "$version" ] && at_least "$version" "$minimum_java"
}

# Versions as the programs report them; empty if they report none.
verilator_version() { verilator --version 2>/dev/null | sed -nE 's/^Verilator ([0-9.]+).*/\1/p' | head -n 1; }
gxx_version() { g++ -dumpfullversion -dumpversion 2>/dev/null | head -n 1; }
make_version() { make --version 2>/dev/null | sed -nE 's/^GNU Make ([0-9.]+).*/\1/p' | head -n 1; }
java_version() { "$1" -version 2>&1 | sed -nE 's/.*version "([0-9]+).*/\1/p' | head -n 1; }
python_version() { "$1" -c 'import sys; print("%d.%d" % sys.version_info[:2])' 2>/dev/null || echo 0; }

# Prints a line with advice for each installed program that is too old.
too_old() {
  local found java
  found="$(verilator_version)"
  [ -z "$found" ] || at_least "$found" "$minimum_verilator" ||
    echo "Verilator $found is too old, $minimum_verilator or newer is needed: use Debian 12, Ubuntu 24.04 or newer, or put a Verilator built from source first on PATH"
  found="$(gxx_version)"
  [ -z "$found" ] || at_least "$found" "$minimum_gxx" ||
    echo "g++ $found is too old, $minimum_gxx or newer is needed (C++17): install g++-$minimum_gxx or newer and put it first on PATH as g++"
  found="$(make_version)"
  [ -z "$found" ] || at_least "$found" "$minimum_make" || echo "GNU Make $found is too old, $minimum_make or newer is needed: put a newer make first on PATH"
  java="$(java_program)"
  if [ -n "$java" ] && ! java_is_new_enough; then
    echo "$java is Java $(java_version "$java"), too old, $minimum_java or newer is needed: unset JAVA_HOME or set it to a JDK $minimum_java"
  fi
  if [ -z "$(python_program)" ] && has python3; then
    echo "Python $(python_version python3) is too old, $minimum_python or newer is needed: set PYTHON to a newer one"
  fi
}

sha256_matches() { [ -f "$1" ] && [ "$(sha256sum "$1" | cut -d' ' -f1)" = "$2" ]; }

# Prints the Debian packages of missing programs on one line, separated by spaces.
missing_packages() {
  local missing=() python
  java_is_new_enough || missing+=(openjdk-17-jdk-headless)
  has verilator || missing+=(verilator)
  has g++ || missing+=(g++)
  has make || missing+=(make)
  # Maven only downloads the sbt launcher, so it is not needed if the launcher exists or COLONNADE_SBT is set.
  [ -n "${COLONNADE_SBT:-}" ] || has mvn || sha256_matches "$sbt_launcher" "$sbt_launcher_sha256" || missing+=(maven)
  python="$(python_program)"
  if [ -z "$python" ] || ! python_is_complete "$python"; then missing+=(python3 python3-venv python3-dev); fi
  echo "${missing[*]}"
}

# A setting of pip's files; nothing if they have none.
pip_setting() {
  { "$(dirname "$uv")/python" -m pip config list 2>/dev/null || true; } | sed -n "s/^[a-z]*\.$1='\(.*\)'\$/\1/p" | tail -n 1
}

# Installs a lock of host/locks into an environment: by uv, or by pip where .venv has no uv yet or uv fails. Both reject
# files whose hash is not in the lock.
# Usage: install_locked ENVIRONMENT LOCK [OPTION OF BOTH]…
install_locked() {
  local environment="$1" lock="$2" log="$root/.cache/pip-$2.log" different="" index certificates place sources=()
  shift 2
  mkdir -p "$root/.cache"
  set -- --no-deps --require-hashes "$@" -r "$root/host/locks/$lock.txt"
  export PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_NO_INPUT=1
  if [ -x "$uv" ]; then
    # uv does not read where pip's settings look for packages, and whose certificates they trust.
    index="${PIP_INDEX_URL:-$(pip_setting index-url)}"
    certificates="${PIP_CERT:-$(pip_setting cert)}"
    [ -z "$index" ] || sources+=(--default-index "$index")
    for place in ${PIP_FIND_LINKS:-}; do sources+=(--find-links "$place"); done
    [ -z "${PIP_NO_INDEX:-}" ] || sources+=(--no-index)
    SSL_CERT_FILE="${certificates:-${SSL_CERT_FILE:-}}" "$uv" pip install --python "$environment/bin/python" "${sources[@]}" "$@" \
      >"$log" 2>&1 </dev/null && return
    different="$(sed -nE 's/.*Hash mismatch for `([^`]*)`.*/\1/p' "$log" | head -n 1)"
  fi
  if [ -z "$different" ]; then
    "$environment/bin/python" -m pip install "$@" >"$log" 2>&1 </dev/null && return
    # pip prints the package in the line after its warning.
    different="$(awk '/DO NOT MATCH THE HASHES/ { getline; sub(/^ */, ""); sub(/ from .*/, ""); print; exit }' "$log")"
  fi
  [ -z "$different" ] || die "the SHA-256 of $different is not in host/locks/$lock.txt; it was not installed: see $log"
  tail -n 20 "$log" >&2
  die "installing the packages of host/locks/$lock.txt failed: see $log"
}
