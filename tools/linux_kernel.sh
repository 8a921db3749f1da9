#!/usr/bin/env bash
# Makes what tools/linux boots: Debian's kernel for arm64 and busybox, and the kernel's UIO driver, which Debian leaves
# out, compiled from Debian's source of the same kernel. apt fetches the packages and checks Debian's signatures; they
# are not installed. Usage: tools/linux_kernel.sh FOLDER, after tools/environment linux
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/programs.sh"
environment="$1"

# apt with lists of its own, so that a foreign architecture does not become one of this system.
{ has apt-get && has dpkg-deb; } || die "Debian's kernel is fetched by apt-get, which is not here"
echo "colonnade: fetching Debian's kernel and its source"
rm -rf "$environment"
work="$environment/work"
mkdir -p "$work"/{lists,cache}/partial "$work/cache/archives/partial" "$work/tree"
touch "$work/status"
log="$root/.cache/linux.log"
host="$(dpkg --print-architecture)"
options=(-o APT::Architecture=arm64 -o APT::Architectures::=arm64 -o "APT::Architectures::=$host" -o APT::Sandbox::User=root
  -o "Dir::State::Lists=$work/lists" -o "Dir::Cache=$work/cache" -o "Dir::State::status=$work/status")
fetch() {
  (cd "$work" && apt-get "${options[@]}" download "$@") >>"$log" 2>&1 </dev/null || die "apt-get download $* failed: see $log"
}
unpack() {
  local package
  for package in "$work"/*.deb; do dpkg-deb -x "$package" "$work/tree"; done
  rm -f "$work"/*.deb
}
{ apt-get "${options[@]}" update </dev/null >"$log" 2>&1 || true; } # what matters is whether the kernel is among them
image="$(apt-cache "${options[@]}" depends linux-image-arm64 2>>"$log" | sed -nE 's/^ *Depends: (linux-image-.*-arm64)$/\1/p' | head -n 1)"
[ -n "$image" ] || die "apt has no linux-image-arm64: this needs Debian's package lists; see $log"
release="${image#linux-image-}" # such as 6.1.0-56-arm64
version="$(apt-cache "${options[@]}" show "$image" | sed -n 's/^Version: //p' | head -n 1)"
base="$(cut -d. -f1,2 <<<"$release")"
headers="linux-headers-$release"
common="linux-headers-${release%-arm64}-common"
# The build tools of this system may be of another revision of the kernel
fetch "$image=$version" busybox-static "$headers=$version" "$common=$version" "linux-kbuild-$base:$host"
unpack
fetch "linux-source-$base=$version"
mkdir "$work/module"
source="linux-source-$base/drivers/uio/uio_pdrv_genirq.c"
dpkg-deb --fsys-tarfile "$work"/linux-source-*.deb | tar xO "./usr/src/linux-source-$base.tar.xz" | tar xJ -C "$work" "$source"
mv "$work/$source" "$work/module"

# The headers name their own folder.
sources="$work/tree/usr/src"
sed -i "s|/usr/src/|$sources/|" "$sources/$headers/Makefile"
echo "obj-m := uio_pdrv_genirq.o" >"$work/module/Makefile"
make -C "$sources/$headers" M="$work/module" ARCH=arm64 CROSS_COMPILE=aarch64-linux-gnu- CC=aarch64-linux-gnu-gcc modules \
  >>"$log" 2>&1 </dev/null || die "the UIO driver does not compile: see $log"
mv "$work/tree/boot/vmlinuz-$release" "$environment/vmlinuz"
mv "$(find "$work/tree" -path '*bin/busybox' -print -quit)" "$environment/busybox"
mv "$(find "$work/tree" -name uio.ko -print -quit)" "$work/module/uio_pdrv_genirq.ko" "$environment"
rm -rf "$work"
echo "$release $version" >"$environment/ready"
