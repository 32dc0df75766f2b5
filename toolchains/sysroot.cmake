# What both toolchains share: with a sysroot, headers and libraries come from it alone and programs (lcm-gen,
# code generators) from the build machine.
if(NOT GROUNDLINE_SYSROOT AND DEFINED ENV{GROUNDLINE_SYSROOT})
  set(GROUNDLINE_SYSROOT "$ENV{GROUNDLINE_SYSROOT}")
endif()
if(GROUNDLINE_SYSROOT)
  if(NOT IS_DIRECTORY "${GROUNDLINE_SYSROOT}/usr/include")
    message(FATAL_ERROR "GROUNDLINE_SYSROOT is \"${GROUNDLINE_SYSROOT}\", which has no usr/include: "
                        "name the root of a Debian tree of the target's architecture.")
  endif()
  set(CMAKE_SYSROOT "${GROUNDLINE_SYSROOT}")
  set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
  set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
  set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
  list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES GROUNDLINE_SYSROOT)
endif()
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
