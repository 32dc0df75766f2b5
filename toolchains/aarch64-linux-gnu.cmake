# Cross build for 64-bit Arm (Raspberry Pi 4/5, Jetson, Rock 5) with Debian's g++-aarch64-linux-gnu: one build for all
# of them. Nothing beyond ARMv8-A with its NEON is used (the kernels want no more), the order of instructions suits
# Cortex-A72.
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(triple aarch64-linux-gnu)
set(debian_architecture arm64)
set(emulator qemu-aarch64)
set(CMAKE_C_FLAGS_INIT "-march=armv8-a -mtune=cortex-a72")
set(CMAKE_CXX_FLAGS_INIT "-march=armv8-a -mtune=cortex-a72")
include(${CMAKE_CURRENT_LIST_DIR}/sysroot.cmake)
