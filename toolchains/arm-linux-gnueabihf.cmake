# Cross build for 32-bit Arm with hardware floating point (Debian armhf: ARMv7-A) and NEON, which every board this is
# for has and Debian's armhf does not ask for, with Debian's g++-arm-linux-gnueabihf.
set(CMAKE_SYSTEM_PROCESSOR armv7l)
set(triple arm-linux-gnueabihf)
set(debian_architecture armhf)
set(emulator qemu-arm)
set(CMAKE_C_FLAGS_INIT "-march=armv7-a -mfpu=neon -mtune=cortex-a72")
set(CMAKE_CXX_FLAGS_INIT "-march=armv7-a -mfpu=neon -mtune=cortex-a72 -Wno-psabi")  # a note about GCC 7's ABI
include(${CMAKE_CURRENT_LIST_DIR}/sysroot.cmake)
