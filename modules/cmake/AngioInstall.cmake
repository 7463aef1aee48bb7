# SPDX-License-Identifier: GPL-2.0-or-later
# `cmake --install` gives a package that find_package(angio) finds.
include(CMakePackageConfigHelpers)
set(_package_dir lib/cmake/angio)
install(EXPORT angioTargets NAMESPACE angio:: DESTINATION ${_package_dir})
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/angioConfig.cmake.in
  ${PROJECT_BINARY_DIR}/angioConfig.cmake INSTALL_DESTINATION ${_package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/angioConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/angioConfig.cmake ${PROJECT_BINARY_DIR}/angioConfigVersion.cmake
              ${CMAKE_CURRENT_LIST_DIR}/AngioDependencies.cmake ${CMAKE_CURRENT_LIST_DIR}/FindVispLibraries.cmake
              ${CMAKE_CURRENT_LIST_DIR}/FindLCM.cmake DESTINATION ${_package_dir})
install(DIRECTORY ${PROJECT_SOURCE_DIR}/examples/data/ DESTINATION share/angio/data)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION share/doc/angio)
