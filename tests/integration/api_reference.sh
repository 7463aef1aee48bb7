#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# api_reference.sh BUILD ROOT: Doxygen over the public headers and the pages of their modules says nothing, each module has its
# group with what its headers declare, and each class and struct has a docstring. Doxygen does warn of a wrong docstring and of a
# missing one. Exit code 77: skipped, and why.
set -euo pipefail
command -v doxygen >/dev/null || { echo "skipped: doxygen is not installed"; exit 77; }
build=$1 root=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# doxygen_of OUT LINES: Doxygen with the build's configuration, some of it given anew.
doxygen_of() {
  mkdir -p "$1"
  { cat "$build/reference/Doxyfile"; printf 'OUTPUT_DIRECTORY = "%s"\n%s\n' "$1" "$2"; } >"$1/Doxyfile"
  nice doxygen "$1/Doxyfile" >"$1/said.txt" 2>&1
}

python3 "$root/modules/cmake/reference/pages.py" "$root" "$build/reference/modules.txt" "$folder/pages.dox"
# The build's own pages.dox is of the target `docs`, and may be old or missing.
inputs=$(sed -n 's/^INPUT = "[^"]*"//p' "$build/reference/Doxyfile")
if ! doxygen_of "$folder/all" "INPUT = \"$folder/pages.dox\" $inputs" || [ -s "$folder/all/said.txt" ]; then
  cat "$folder/all/said.txt"
  exit 1
fi
count=0
while read -r module _; do
  page=$folder/all/html/group__${module//_/__}.html
  grep -q "angio::$module" "$page" || { echo "$module: $page is missing or empty"; exit 1; }
  grep -qE '#(nested-classes|func-members|typedef-members)"' "$page" || { echo "$module: nothing is declared in its group"; exit 1; }
  count=$((count + 1))
done <"$build/reference/modules.txt"
[ "$count" -gt 0 ]
echo "$count modules, silent"

# undocumented OUT LINES: the classes without a docstring. Members may be told by their class's.
undocumented() {
  doxygen_of "$1" "EXTRACT_ALL = NO
WARN_IF_UNDOCUMENTED = YES
WARN_AS_ERROR = NO
GENERATE_HTML = NO
GENERATE_XML = YES
$2" || true
  grep -E 'Compound .* is not documented' "$1/said.txt" || true
}
classes=$(undocumented "$folder/classes" "INPUT = \"$folder/pages.dox\" $inputs")
if [ -n "$classes" ]; then
  echo "$classes"
  exit 1
fi

mkdir "$folder/wrong"
cat >"$folder/wrong/wrong.hpp" <<'HEADER'
namespace angio::base {
/// @param length_mm  Not the parameter's name.
double area(double length_m);
struct Plain {
  double length_m;
};
}  // namespace angio::base
HEADER
if doxygen_of "$folder/out" "INPUT = \"$folder/wrong\"" || ! grep -q "argument 'length_mm' of command @param" "$folder/out/said.txt"; then
  echo "a wrong name of a parameter went unseen"
  exit 1
fi
if [ "$(undocumented "$folder/plain" "INPUT = \"$folder/wrong\"" | wc -l)" -ne 1 ]; then
  echo "a struct without a docstring went unseen"
  exit 1
fi
