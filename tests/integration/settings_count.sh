#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Counts the keys that settings structs declare, each struct's once, and fails above a number: settings_count.sh 370.
# Messages describe their fields in the same words, and modules/base has an example: both are left out. Run in the sources' folder.
set -eu
max=$1
count=$(find modules servo calibration \( -name '*.hpp' -o -name '*.cpp' \) ! -path 'modules/messaging/src/*' ! -path 'modules/base/*' -exec cat {} + |
  tr '\n' ' ' | grep -oE '\bv\.(number|integer|flag|numbers|choice|choiceIndex)\( *"[a-z0-9_]+",' | wc -l)
echo "$count settings keys"
[ "$count" -gt 0 ] && [ "$count" -le "$max" ]
