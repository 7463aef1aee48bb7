#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# deb.sh [--all] PACKAGES [FOLDER]: installs the Debian packages that `cpack -G DEB` wrote into the folder PACKAGES on a bare
# Debian 12, uses them and purges them. FOLDER, made when missing, gets the Debian's root and the tests' output; without it a
# folder under /tmp is used and removed. A root that is there from an earlier run is used again. --all builds also what needs
# the recommended packages: each component alone, and all together. Needs root, debootstrap and network, and so is run by hand.
set -euo pipefail

everything=no
if [ "${1:-}" = --all ]; then
  everything=yes
  shift
fi
[ $# -ge 1 ] || { sed -n '3,8s/^# //p' "$0" >&2; exit 2; }
packages=$(realpath "$1")
here=$(realpath "$(dirname "$0")")
[ "$(id -u)" -eq 0 ] || { echo "deb.sh needs root: it makes a root folder of its own and changes into it" >&2; exit 1; }
command -v debootstrap >/dev/null || { echo "deb.sh needs debootstrap" >&2; exit 1; }
for name in angio-tools libangio-dev python3-angio; do
  [ "$(find "$packages" -name "${name}_*.deb" | wc -l)" -eq 1 ] || { echo "$packages: there is not one $name package" >&2; exit 1; }
done
if [ $# -ge 2 ]; then
  mkdir -p "$2"
  folder=$(realpath "$2")
else
  folder=$(mktemp -d /tmp/angio-bare-XXXXXX)
  trap 'rm -rf --one-file-system "$folder"' EXIT
fi
root=$folder/root
mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}
if ! [ -f "$root/bin/dpkg" ] || ! [ -f "$folder/made" ]; then
  echo "a bare Debian 12 in $root"
  debootstrap --variant=minbase bookworm "$root" "$mirror" >"$folder/debootstrap.txt" || { tail -n 5 "$folder/debootstrap.txt"; exit 1; }
  touch "$folder/made"
fi
[ $everything = no ] || rm "$folder/made"  # It will not be bare again.
cat >"$root/etc/apt/sources.list" <<LIST
deb $mirror bookworm main
deb $mirror bookworm-updates main
deb ${DEBIAN_SECURITY_MIRROR:-http://deb.debian.org/debian-security} bookworm-security main
LIST
cp /etc/resolv.conf "$root/etc/resolv.conf"
rm -rf "$root/given"
mkdir "$root/given"
cp "$packages"/angio-tools_*.deb "$packages"/libangio-dev_*.deb "$packages"/python3-angio_*.deb "$root/given"
cp -r "$here/registration" "$here/everything" "$here/../../examples/02_find_package" "$here/../../examples/10_python" "$root/given"

cat >"$root/given/inside.sh" <<'INSIDE'
set -euo pipefail
export DEBIAN_FRONTEND=noninteractive LC_ALL=C.UTF-8
step() { printf '\n== %s\n' "$*"; }
get() { apt-get -y -q "$@" >/given/apt.txt 2>&1 || { tail -n 20 /given/apt.txt; exit 1; }; }
# As somebody who owns nothing but a folder.
user() { (cd /given/home && runuser -u nobody -- env HOME=/given/home "$@"); }
mkdir -p /given/home
chown nobody /given/home
chmod 755 /given

dpkg --purge angio-tools libangio-dev python3-angio >/dev/null 2>&1 || true  # Of a run that failed.
get update
step "angio-tools: installed with what it depends on, nothing recommended"
get install --no-install-recommends /given/angio-tools_*.deb
dpkg -s angio-tools | grep -E '^(Section|Installed-Size|Maintainer|Architecture|Version):'
grep -q '^License: GPL-2+' /usr/share/doc/angio-tools/copyright
dpkg -L angio-tools >/given/files.txt
for program in $(grep '^/usr/bin/.' /given/files.txt); do
  user "$program" --help >/dev/null || { echo "$program --help failed"; exit 1; }
done
echo "$(grep -c '^/usr/bin/.' /given/files.txt) programs say what they do"
data=/usr/share/angio/data/static-phantom
user angio-register --tree $data/tree.csv --image $data/dicom/im5.dcm --frame 2 --t-dsa-cb $data/dicom/t_dsa_cb.yaml \
  --out registered.json --overlay registered.png
grep -q '"status": *"converged"' /given/home/registered.json
[ -s /given/home/registered.png ]
user angio-servo --simulate --duration-s 1 --out servo >/given/home/servo.txt
tail -n 3 /given/home/servo.txt
[ -s /given/home/servo/summary.json ]

step "python3-angio: registers, and draws what came of it"
get install --no-install-recommends /given/python3-angio_*.deb python3-matplotlib
dpkg -s python3-angio | grep -E '^(Section|Installed-Size|Depends):'
dpkg -L python3-angio >>/given/files.txt
user python3 /given/10_python/register_and_plot.py $data .
[ -s /given/home/registered.png ] && [ -s /given/home/uncertainty.png ]

step "libangio-dev: the component registration in a project of one's own, without what the others need"
get install --no-install-recommends /given/libangio-dev_*.deb g++ cmake make
dpkg -s libangio-dev | grep -E '^(Section|Installed-Size|Depends|Recommends):'
dpkg -L libangio-dev >>/given/files.txt
for absent in libvtk9-dev libdcmtk-dev libinsighttoolkit5-dev liblcm-dev libcli11-dev; do
  ! dpkg -s $absent >/dev/null 2>&1 || { echo "$absent is installed, and nothing should need it"; exit 1; }
done
user cmake -S /given/registration -B registration -DCMAKE_BUILD_TYPE=Release >/given/cmake.txt 2>&1 || { cat /given/cmake.txt; exit 1; }
user cmake --build registration
user registration/align_points /given/registration/tree.txt /given/registration/image.txt

if [ "$1" = yes ]; then
  step "with the recommended packages: each component alone, all together, and the example"
  # shellcheck disable=SC2046  # A list of names.
  get install --no-install-recommends $(dpkg-query -W -f '${Recommends}' libangio-dev | tr -d ,)
  for project in everything 02_find_package; do
    user cmake -S /given/$project -B $project -DCMAKE_BUILD_TYPE=Release >/given/cmake.txt 2>&1 || { cat /given/cmake.txt; exit 1; }
    user cmake --build $project
  done
  user everything/everything
  user 02_find_package/my_robot
fi

step "purged"
get purge angio-tools libangio-dev python3-angio
left=0
while read -r path; do
  # A folder that other packages have too stays.
  if [ -e "$path" ] && ! dpkg -S "$path" >/dev/null 2>&1; then
    echo "left: $path"
    left=1
  fi
done </given/files.txt
find / -xdev \( -path /proc -o -path /given -o -path /var/log -o -path /var/lib/apt -o -path /var/cache \) -prune -o -iname '*angio*' -print >/given/left.txt
cat /given/left.txt
if [ $left -ne 0 ] || [ -s /given/left.txt ] || grep -i angio /var/lib/dpkg/status; then
  exit 1
fi
echo "nothing is left"
INSIDE
# What is mounted and runs in there ends with it.
# shellcheck disable=SC2016  # The inner shell's own arguments.
unshare --mount --pid --fork --kill-child bash -c '
  mount --make-rprivate / && mount -t proc proc "$1/proc" && mount --rbind /dev "$1/dev" && exec chroot "$1" bash /given/inside.sh "$2"
' deb.sh "$root" "$everything"
