# SPDX-License-Identifier: GPL-2.0-or-later
# `cmake --install` gives a package that find_package(angio COMPONENTS ...) finds. Each module is a component of the package, and
# one of the installation: `cmake --install build --component registration` installs that module alone. The package's own
# files are the installation's component `package`. Programs and example data are `programs` and `data`.
include(CMakePackageConfigHelpers)
set(_package_dir lib/cmake/angio)

# angio_find_calls(module links out packages): the find_dependency() calls for what the module links from outside, one a line; and
# the packages that they find, where one that gives parts is listed as package::part.
function(angio_find_calls module links out packages)
  set(_calls)
  set(_found)
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
      list(TRANSFORM _brought PREPEND ${_package}::)
      list(APPEND _found ${_brought})
    else()
      list(APPEND _found ${_package})
    endif()
    list(PREPEND _call ${_package})
    list(JOIN _call " " _call)
    string(APPEND _calls "find_dependency(${_call})\n")
  endforeach()
  if(links)
    message(FATAL_ERROR "module '${module}' links '${links}', which no package in AngioDependencies.cmake brings")
  endif()
  set(${out} "${_calls}" PARENT_SCOPE)
  set(${packages} "${_found}" PARENT_SCOPE)
endfunction()

get_property(_modules GLOBAL PROPERTY ANGIO_MODULES)
set(_modules_under)
foreach(_module ${_modules})
  # What is hidden counts: a static library's users link it too.
  get_target_property(_type angio_${_module} TYPE)
  if(_type STREQUAL "INTERFACE_LIBRARY")
    get_target_property(_links angio_${_module} INTERFACE_LINK_LIBRARIES)
  else()
    get_target_property(_links angio_${_module} LINK_LIBRARIES)
  endif()
  if(NOT _links)
    set(_links)
  endif()
  set(_used ${_links})
  list(FILTER _used INCLUDE REGEX "^angio::")
  list(FILTER _links EXCLUDE REGEX "^angio::")
  list(TRANSFORM _used REPLACE "^angio::" "")
  set(_under_${_module})
  foreach(_lower ${_used})
    list(APPEND _under_${_module} ${_under_${_lower}} ${_lower})
  endforeach()
  list(REMOVE_DUPLICATES _under_${_module})
  list(JOIN _under_${_module} " " _listed)
  string(APPEND _modules_under "set(_angio_under_${_module} ${_listed})\n")

  angio_find_calls(${_module} "${_links}" _find_calls _packages_of_${_module})
  configure_file(${CMAKE_CURRENT_LIST_DIR}/angioComponent.cmake.in ${PROJECT_BINARY_DIR}/components/${_module}.cmake @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/components/${_module}.cmake DESTINATION ${_package_dir}/components COMPONENT ${_module})
  install(EXPORT angio_${_module} NAMESPACE angio:: DESTINATION ${_package_dir}/components FILE ${_module}Targets.cmake
          COMPONENT ${_module})
endforeach()

list(JOIN _modules " " _modules)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/angioConfig.cmake.in ${PROJECT_BINARY_DIR}/angioConfig.cmake
  INSTALL_DESTINATION ${_package_dir} NO_SET_AND_CHECK_MACRO NO_CHECK_REQUIRED_COMPONENTS_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/angioConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/angioConfig.cmake ${PROJECT_BINARY_DIR}/angioConfigVersion.cmake
              ${CMAKE_CURRENT_LIST_DIR}/FindVispLibraries.cmake ${CMAKE_CURRENT_LIST_DIR}/FindLCM.cmake
              ${CMAKE_CURRENT_LIST_DIR}/FindOpenIGTLink.cmake
              ${CMAKE_CURRENT_LIST_DIR}/FindItkLibraries.cmake
        DESTINATION ${_package_dir} COMPONENT package)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/examples/data/ DESTINATION share/angio/data COMPONENT data)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION share/doc/angio COMPONENT licence)
