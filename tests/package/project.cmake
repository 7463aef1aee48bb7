# SPDX-License-Identifier: GPL-2.0-or-later
# What the package tests have in common.

# Runs a command; the test fails with it. What it printed is in `output`.
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT code EQUAL 0)
    message(FATAL_ERROR "failed (${code}): ${ARGN}\n${output}")
  endif()
  set(output "${output}" PARENT_SCOPE)
endfunction()

# build_project(source folder options...): configures and builds a project with the installation in ${WORK}/prefix.
function(build_project source folder)
  run(${CMAKE_COMMAND} -S ${source} -B ${folder} -G Ninja -DCMAKE_BUILD_TYPE=Release -DCMAKE_PREFIX_PATH=${WORK}/prefix
      -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_CXX_FLAGS=${CXX_FLAGS} -DCMAKE_EXE_LINKER_FLAGS=${LINKER_FLAGS} ${ARGN})
  run(${CMAKE_COMMAND} --build ${folder})
endfunction()

# Which of the libraries that a registration does not need a program links: on its link line, or through others.
function(find_needless_libraries folder program out)
  run(ninja -C ${folder} -t commands ${program})
  set(text "${output}")
  run(ldd ${folder}/${program})
  string(APPEND text "${output}")
  set(found)
  foreach(library lcm vtk dcmdata ITK yaml-cpp)
    if(text MATCHES "(/lib|-l)${library}")
      list(APPEND found ${library})
    endif()
  endforeach()
  set(${out} "${found}" PARENT_SCOPE)
endfunction()
