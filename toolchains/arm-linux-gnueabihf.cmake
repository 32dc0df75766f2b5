# Cross build for 32-bit Arm with hardware floating point (Debian armhf: ARMv7-A) and NEON, which every board
# this is for has, with Debian's g++-arm-linux-gnueabihf.
# Libraries come from the sysroot named by GROUNDLINE_SYSROOT (cache or environment variable), for example an
# armhf Debian tree; without one, from the build machine's own armhf multiarch packages.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR armv7l)
set(CMAKE_C_COMPILER arm-linux-gnueabihf-gcc)
set(CMAKE_CXX_COMPILER arm-linux-gnueabihf-g++)
set(CMAKE_C_FLAGS_INIT "-mfpu=neon")
set(CMAKE_CXX_FLAGS_INIT "-mfpu=neon -Wno-psabi")  # -Wno-psabi: a note about GCC 7's ABI, of no interest here
include(${CMAKE_CURRENT_LIST_DIR}/sysroot.cmake)
