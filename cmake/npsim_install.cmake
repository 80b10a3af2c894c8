# SPDX-License-Identifier: Apache-2.0
# Installs the headers, the CMake package and the pkg-config file.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

set(npsim_cmake_dir "${CMAKE_INSTALL_LIBDIR}/cmake/npsim")

install(DIRECTORY "${PROJECT_SOURCE_DIR}/include/npsim" DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}"
        FILES_MATCHING PATTERN "*.hpp")
install(TARGETS npsim EXPORT npsim_targets INCLUDES DESTINATION "${CMAKE_INSTALL_INCLUDEDIR}")
install(EXPORT npsim_targets NAMESPACE npsim:: FILE npsim-targets.cmake DESTINATION "${npsim_cmake_dir}")
foreach(component io eigen)
  install(TARGETS npsim_${component} EXPORT npsim_${component}_targets)
  install(EXPORT npsim_${component}_targets NAMESPACE npsim:: FILE npsim-${component}-targets.cmake
          DESTINATION "${npsim_cmake_dir}")
endforeach()

configure_package_config_file("${CMAKE_CURRENT_LIST_DIR}/npsim-config.cmake.in" "${CMAKE_BINARY_DIR}/npsim-config.cmake"
                              INSTALL_DESTINATION "${npsim_cmake_dir}")
write_basic_package_version_file("${CMAKE_BINARY_DIR}/npsim-config-version.cmake" COMPATIBILITY SameMinorVersion
                                 ARCH_INDEPENDENT)
install(FILES "${CMAKE_BINARY_DIR}/npsim-config.cmake" "${CMAKE_BINARY_DIR}/npsim-config-version.cmake"
              "${CMAKE_CURRENT_LIST_DIR}/npsim_dependencies.cmake" DESTINATION "${npsim_cmake_dir}")

set(npsim_pc_flags "")
if(NPSIM_STRICT_FP)
  string(APPEND npsim_pc_flags " -ffp-contract=off")
endif()
get_target_property(npsim_scalar npsim::xsimd INTERFACE_COMPILE_DEFINITIONS)
if(npsim_scalar)  # an xsimd that is too old: see npsim_dependencies.cmake
  string(APPEND npsim_pc_flags " -D${npsim_scalar}")
  set(npsim_pc_requires "")
else()
  set(npsim_pc_requires "xsimd >= 8")
endif()
# Relative to the file itself, so that the installed tree can be moved.
file(RELATIVE_PATH npsim_pc_to_prefix "/${CMAKE_INSTALL_DATADIR}/pkgconfig" "/")
configure_file("${CMAKE_CURRENT_LIST_DIR}/npsim.pc.in" "${CMAKE_BINARY_DIR}/npsim.pc" @ONLY)
install(FILES "${CMAKE_BINARY_DIR}/npsim.pc" DESTINATION "${CMAKE_INSTALL_DATADIR}/pkgconfig")
install(FILES "${PROJECT_SOURCE_DIR}/LICENSE" DESTINATION "${CMAKE_INSTALL_DOCDIR}")
