# SPDX-License-Identifier: GPL-2.0-or-later
# A program that drives a machine links no simulation, nor what needs one; CLOSURES is "program: library library ...", one for each program.
foreach(closure ${CLOSURES})
  string(REGEX REPLACE "^([^:]*):.*" "\\1" program "${closure}")
  string(REGEX MATCHALL "angio_(simulation|lab|experiments|evaluation|calibration) " found "${closure} ")
  if(program STREQUAL "angio-servo-simulated")
    if(NOT found MATCHES "angio_simulation " OR NOT found MATCHES "angio_lab ")
      message(FATAL_ERROR "${program} simulates, and the simulation was not seen in ${closure}")
    endif()
  elseif(found)
    message(FATAL_ERROR "${program} links ${found}")
  endif()
endforeach()
