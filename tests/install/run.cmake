# SPDX-License-Identifier: Apache-2.0
set(work "${binary_dir}/tests/install/work")
set(prefix "${work}/prefix")
file(REMOVE_RECURSE "${work}")

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    string(REPLACE ";" " " command "${ARGN}")
    message(FATAL_ERROR "${command}\nfailed with ${status}:\n${output}")
  endif()
endfunction()

run("${CMAKE_COMMAND}" --install "${binary_dir}" --prefix "${prefix}")

foreach(way find_package add_subdirectory)
  run("${CMAKE_COMMAND}" -S "${source_dir}/tests/install/${way}" -B "${work}/${way}" -G "${generator}"
      "-DCMAKE_CXX_COMPILER=${cxx}" "-DCMAKE_PREFIX_PATH=${prefix}" "-Dnpsim_source_dir=${source_dir}"
      "-Dnpsim_version=${version}")
  run("${CMAKE_COMMAND}" --build "${work}/${way}")
  run("${work}/${way}/consumer" "${version}")
endforeach()
run("${work}/find_package/host_consumer")
run("${work}/find_package/eigen_consumer")

find_program(pkg_config NAMES pkg-config pkgconf)
if(NOT pkg_config)
  message("pkg-config is not installed: that part of the test is skipped")
  return()
endif()
set(ENV{PKG_CONFIG_PATH} "${prefix}/share/pkgconfig")
# `program` of `source`, with the flags of these packages.
function(build_with_pkg_config program source)
  execute_process(COMMAND "${pkg_config}" --print-errors --cflags ${ARGN}
                  RESULT_VARIABLE status OUTPUT_VARIABLE flags ERROR_VARIABLE errors OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "pkg-config --cflags ${ARGN} failed: ${errors}")
  endif()
  separate_arguments(flags UNIX_COMMAND "${flags}")
  run("${cxx}" -std=c++17 ${flags} "${source_dir}/tests/install/${source}" -o "${program}")
endfunction()

execute_process(COMMAND "${pkg_config}" --print-requires npsim OUTPUT_VARIABLE requires)
if(requires MATCHES "eigen")
  message(FATAL_ERROR "npsim.pc asks for Eigen")
endif()
build_with_pkg_config("${work}/pkg_config_consumer" consumer.cpp npsim)
run("${work}/pkg_config_consumer" "${version}")
build_with_pkg_config("${work}/pkg_config_eigen_consumer" eigen_consumer.cpp npsim eigen3)
run("${work}/pkg_config_eigen_consumer")
