# SPDX-License-Identifier: GPL-2.0-or-later

# angio_add_module(room SOURCES ... USES rooms... [LINKS outside, seen in headers] [HIDES outside, seen in sources only])
#
# Adds the library angio::<room> with the room's own include folder, which is a component of the installed package. USES accepts
# only rooms that already stand. A room without SOURCES is its headers alone: who uses it links nothing of it.
function(angio_add_module room)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES;LINKS;HIDES" ${ARGN})
  if(ARG_SOURCES)
    set(_public PUBLIC)
    add_library(angio_${room} STATIC ${ARG_SOURCES})
    target_link_libraries(angio_${room} PRIVATE ${ARG_HIDES})
    angio_set_warnings(angio_${room})
  else()
    set(_public INTERFACE)
    add_library(angio_${room} INTERFACE)
  endif()
  add_library(angio::${room} ALIAS angio_${room})
  set_target_properties(angio_${room} PROPERTIES EXPORT_NAME ${room})
  foreach(_used ${ARG_USES})
    if(NOT TARGET angio_${_used})
      message(FATAL_ERROR "room '${room}' uses '${_used}', which does not stand below it")
    endif()
    target_link_libraries(angio_${room} ${_public} angio::${_used})
  endforeach()
  target_include_directories(angio_${room} ${_public}
    $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:include>)
  target_link_libraries(angio_${room} ${_public} ${ARG_LINKS})
  target_compile_features(angio_${room} ${_public} cxx_std_17)
  set_property(GLOBAL APPEND PROPERTY ANGIO_ROOMS ${room})
  install(TARGETS angio_${room} EXPORT angio_${room} ARCHIVE DESTINATION lib COMPONENT ${room})
  install(DIRECTORY include/ DESTINATION include COMPONENT ${room} OPTIONAL)
endfunction()

# angio_add_program(name SOURCES ... USES rooms... [LINKS ...]): a program in build/bin, installed to bin.
function(angio_add_program name)
  cmake_parse_arguments(ARG "" "" "SOURCES;USES;LINKS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  list(TRANSFORM ARG_USES PREPEND angio::)
  target_link_libraries(${name} PRIVATE ${ARG_USES} ${ARG_LINKS})
  angio_set_warnings(${name})
  install(TARGETS ${name} RUNTIME DESTINATION bin)
endfunction()

function(angio_set_warnings target)
  target_compile_options(${target} PRIVATE -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -fno-math-errno)
endfunction()
