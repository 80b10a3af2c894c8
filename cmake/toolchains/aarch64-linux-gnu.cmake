# SPDX-License-Identifier: Apache-2.0
# Debian's and Ubuntu's cross compiler (package g++-aarch64-linux-gnu); tests run under qemu-user where it is there.
#
# This compiler searches /usr/include after its own folders, so the header-only packages xsimd and doctest of
# the host are found without a sysroot. Libraries of the host are never linked: the core needs none.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)

find_program(NPSIM_QEMU_AARCH64 NAMES qemu-aarch64 qemu-aarch64-static)
mark_as_advanced(NPSIM_QEMU_AARCH64)
if(NPSIM_QEMU_AARCH64)
  set(CMAKE_CROSSCOMPILING_EMULATOR "${NPSIM_QEMU_AARCH64};-L;/usr/aarch64-linux-gnu")
endif()
