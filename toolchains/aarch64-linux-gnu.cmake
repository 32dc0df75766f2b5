# Cross build for 64-bit Arm (Raspberry Pi 4/5, Jetson, Rock 5) with Debian's g++-aarch64-linux-gnu.
# Libraries come from the sysroot named by GROUNDLINE_SYSROOT (cache or environment variable), for example an
# arm64 Debian tree; without one, from the build machine's own arm64 multiarch packages.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
include(${CMAKE_CURRENT_LIST_DIR}/sysroot.cmake)
