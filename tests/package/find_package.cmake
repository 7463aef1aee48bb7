# SPDX-License-Identifier: GPL-2.0-or-later
include(${CMAKE_CURRENT_LIST_DIR}/project.cmake)

file(REMOVE_RECURSE ${WORK})
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix)
build_project(${EXAMPLE} ${WORK}/example)
run(${WORK}/example/my_robot)
build_project(${CMAKE_CURRENT_LIST_DIR}/everything ${WORK}/everything)
run(${WORK}/everything/everything)
# The search that finds nothing in package.registration finds them where they are.
find_needless_libraries(${WORK}/everything everything found)
if(NOT found MATCHES "lcm;vtk;dcmdata;(ITK;)?yaml-cpp")
  message(FATAL_ERROR "everything links lcm, vtk, dcmdata and yaml-cpp, and of these were seen: ${found}")
endif()
run(${WORK}/prefix/bin/angio-servo --simulate --duration-s 0.1 --out ${WORK}/demo-output)
if(NOT EXISTS ${WORK}/demo-output/summary.json)
  message(FATAL_ERROR "the installed angio-servo wrote no summary")
endif()
file(REMOVE_RECURSE ${WORK})
