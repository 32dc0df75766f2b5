# What both toolchains share: headers and libraries come from a sysroot alone (toolchains/make-sysroot.sh makes one),
# programs (lcm-gen) from the build machine, and what is built runs here under QEMU.
# C library and C++ library are the compiler's own, those of its Debian release: the sysroot's must not be older.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_C_COMPILER ${triple}-gcc)
set(CMAKE_CXX_COMPILER ${triple}-g++)
set(CMAKE_LIBRARY_ARCHITECTURE ${triple})

if(NOT GROUNDLINE_SYSROOT)
  get_filename_component(GROUNDLINE_SYSROOT "${CMAKE_CURRENT_LIST_DIR}/../build/sysroot-${debian_architecture}" ABSOLUTE)
endif()
if(NOT EXISTS "${GROUNDLINE_SYSROOT}/made")
  message(FATAL_ERROR "There is no sysroot of ${debian_architecture} at ${GROUNDLINE_SYSROOT}: make it by "
                      "toolchains/make-sysroot.sh ${debian_architecture} FOLDER, name it by -DGROUNDLINE_SYSROOT=FOLDER.")
endif()
set(CMAKE_SYSROOT "${GROUNDLINE_SYSROOT}")
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES GROUNDLINE_SYSROOT)
set(ENV{PKG_CONFIG_SYSROOT_DIR} "${GROUNDLINE_SYSROOT}")
set(ENV{PKG_CONFIG_LIBDIR} "${GROUNDLINE_SYSROOT}/usr/lib/${triple}/pkgconfig:${GROUNDLINE_SYSROOT}/usr/share/pkgconfig")
if(NOT EXISTS "${GROUNDLINE_SYSROOT}/usr/lib/${triple}/cmake/opencv4/OpenCVConfig.cmake")
  set(OpenCV_DIR "${CMAKE_CURRENT_LIST_DIR}/opencv")
endif()

find_program(GROUNDLINE_EMULATOR NAMES ${emulator} ${emulator}-static)
if(GROUNDLINE_EMULATOR)
  set(CMAKE_CROSSCOMPILING_EMULATOR "${GROUNDLINE_EMULATOR};-L;${GROUNDLINE_SYSROOT}")
endif()

# CPack takes the build machine's architecture else, and dpkg-shlibdeps finds no library: seen from these folders it
# finds the records in the sysroot's DEBIAN.
set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE ${debian_architecture})
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS_PRIVATE_DIRS "${GROUNDLINE_SYSROOT}/usr/lib/${triple}")
