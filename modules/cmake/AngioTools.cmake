# SPDX-License-Identifier: GPL-2.0-or-later
# Tools that make builds quicker and change nothing of what is built, where they are installed.
option(ANGIO_USE_CCACHE "Compile through ccache where it is installed" ON)
option(ANGIO_USE_MOLD "Link with mold where it is installed and the compiler knows it (GCC 12, clang 12)" ON)

# A launcher that somebody has set, and be it none, stays.
if(ANGIO_USE_CCACHE AND NOT DEFINED CMAKE_CXX_COMPILER_LAUNCHER)
  find_program(ANGIO_CCACHE ccache)
  mark_as_advanced(ANGIO_CCACHE)
  if(ANGIO_CCACHE)
    set(CMAKE_CXX_COMPILER_LAUNCHER ${ANGIO_CCACHE})
  endif()
endif()

if(ANGIO_USE_MOLD)
  include(CheckLinkerFlag)
  check_linker_flag(CXX -fuse-ld=mold ANGIO_HAVE_MOLD)
  if(ANGIO_HAVE_MOLD)
    add_link_options(-fuse-ld=mold)
  endif()
endif()

# Several sources of a target are compiled as one, so that the headers that they share are read once: they are half of a
# source's time. A source that uses what another includes compiles so, and is found by a build with CMAKE_UNITY_BUILD=OFF.
if(NOT DEFINED CMAKE_UNITY_BUILD)
  set(CMAKE_UNITY_BUILD ON)
  set(CMAKE_UNITY_BUILD_BATCH_SIZE 8)
endif()
