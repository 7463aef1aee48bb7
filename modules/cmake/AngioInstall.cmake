# SPDX-License-Identifier: GPL-2.0-or-later
# `cmake --install` gives a package that find_package(angio COMPONENTS ...) finds. Each room is a component of the package, and
# one of the installation: `cmake --install build --component registration` installs that room alone. The package's own
# files are the installation's component `package`.
include(CMakePackageConfigHelpers)
set(_package_dir lib/cmake/angio)

# angio_find_calls(room links out): the find_dependency() calls for what the room links from outside, one a line.
function(angio_find_calls room links out)
  set(_calls)
  get_property(_packages GLOBAL PROPERTY ANGIO_PACKAGES)
  foreach(_package ${_packages})
    get_property(_prefix GLOBAL PROPERTY ANGIO_PACKAGE_${_package}_PREFIX)
    get_property(_call GLOBAL PROPERTY ANGIO_PACKAGE_${_package}_ARGUMENTS)
    set(_brought ${links})
    list(FILTER _brought INCLUDE REGEX "^${_prefix}")
    if(NOT _brought)
      continue()
    endif()
    list(REMOVE_ITEM links ${_brought})
    list(FIND _call COMPONENTS _first)
    if(NOT _first EQUAL -1)
      list(SUBLIST _call 0 ${_first} _call)
      list(TRANSFORM _brought REPLACE "^${_prefix}" "")
      list(REMOVE_DUPLICATES _brought)
      list(APPEND _call COMPONENTS ${_brought})
    endif()
    list(PREPEND _call ${_package})
    list(JOIN _call " " _call)
    string(APPEND _calls "find_dependency(${_call})\n")
  endforeach()
  if(links)
    message(FATAL_ERROR "room '${room}' links '${links}', which no package in AngioDependencies.cmake brings")
  endif()
  set(${out} "${_calls}" PARENT_SCOPE)
endfunction()

get_property(_rooms GLOBAL PROPERTY ANGIO_ROOMS)
set(_rooms_under)
foreach(_room ${_rooms})
  # What is hidden counts: a static library's users link it too.
  get_target_property(_type angio_${_room} TYPE)
  if(_type STREQUAL "INTERFACE_LIBRARY")
    get_target_property(_links angio_${_room} INTERFACE_LINK_LIBRARIES)
  else()
    get_target_property(_links angio_${_room} LINK_LIBRARIES)
  endif()
  if(NOT _links)
    set(_links)
  endif()
  set(_used ${_links})
  list(FILTER _used INCLUDE REGEX "^angio::")
  list(FILTER _links EXCLUDE REGEX "^angio::")
  list(TRANSFORM _used REPLACE "^angio::" "")
  set(_under_${_room})
  foreach(_lower ${_used})
    list(APPEND _under_${_room} ${_under_${_lower}} ${_lower})
  endforeach()
  list(REMOVE_DUPLICATES _under_${_room})
  list(JOIN _under_${_room} " " _listed)
  string(APPEND _rooms_under "set(_angio_under_${_room} ${_listed})\n")

  angio_find_calls(${_room} "${_links}" _find_calls)
  configure_file(${CMAKE_CURRENT_LIST_DIR}/angioComponent.cmake.in ${PROJECT_BINARY_DIR}/components/${_room}.cmake @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/components/${_room}.cmake DESTINATION ${_package_dir}/components COMPONENT ${_room})
  install(EXPORT angio_${_room} NAMESPACE angio:: DESTINATION ${_package_dir}/components FILE ${_room}Targets.cmake
          COMPONENT ${_room})
endforeach()

list(JOIN _rooms " " _rooms)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/angioConfig.cmake.in ${PROJECT_BINARY_DIR}/angioConfig.cmake
  INSTALL_DESTINATION ${_package_dir} NO_SET_AND_CHECK_MACRO NO_CHECK_REQUIRED_COMPONENTS_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/angioConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/angioConfig.cmake ${PROJECT_BINARY_DIR}/angioConfigVersion.cmake
              ${CMAKE_CURRENT_LIST_DIR}/FindVispLibraries.cmake ${CMAKE_CURRENT_LIST_DIR}/FindLCM.cmake
              ${CMAKE_CURRENT_LIST_DIR}/FindItkLibraries.cmake
        DESTINATION ${_package_dir} COMPONENT package)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/examples/data/ DESTINATION share/angio/data)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION share/doc/angio)
