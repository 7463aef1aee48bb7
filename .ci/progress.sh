#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-2.0-or-later
# Makes of ninja's lines, with NINJA_STATUS='@%f/%t ', one that a person can read: how many of how many are built, about
# how many minutes are left, and what was the last. A terminal has one line that changes, else there is one for each
# tenth. All that is not progress, as what a compiler says, passes.
set -euo pipefail
width=0
if [ -t 1 ]; then width=$(tput cols 2>/dev/null || echo 80); fi
open=0 tenth=0 began=$SECONDS
while IFS= read -r line || [ -n "$line" ]; do
  if ! [[ $line =~ ^@([0-9]+)/([0-9]+)\ (.*)$ ]]; then
    [ "$line" = "ninja: no work to do." ] && continue
    if [ $open -eq 1 ]; then printf '\n'; open=0; fi
    printf '%s\n' "$line"
    continue
  fi
  count=${BASH_REMATCH[1]} total=${BASH_REMATCH[2]} what=${BASH_REMATCH[3]##* }
  [[ $what =~ ^(.*/)?CMakeFiles/[^/]*\.dir/(.*)\.o$ ]] && what=${BASH_REMATCH[1]}${BASH_REMATCH[2]}
  # Of several sources in one: their folder.
  what=${what%/Unity/unity_*}
  # Too early to tell at first; seconds are rounded up.
  left=
  if [ $((20 * count)) -ge "$total" ]; then
    minutes=$((((SECONDS - began) * (total - count) / count + 59) / 60))
    if [ $minutes -gt 1 ]; then left=", about $minutes minutes left"; else left=", less than a minute left"; fi
    if [ "$count" -eq "$total" ]; then left=; fi
  fi
  text="Building: $count of $total$left: $what"
  if [ "$width" -gt 0 ]; then
    printf '\r\033[K%s' "${text:0:$((width - 1))}"
    open=1
  elif [ $((10 * count / total)) -gt $tenth ] || [ "$count" -eq 1 ]; then
    tenth=$((10 * count / total))
    printf '%s\n' "$text"
  fi
done
if [ $open -eq 1 ]; then printf '\n'; fi
