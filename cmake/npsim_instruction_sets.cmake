# SPDX-License-Identifier: Apache-2.0
# Programs that hold objects for several instruction sets: samples/dispatch and tests/dispatch.
set(npsim_x86_64 FALSE)
if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64|amd64)$" AND CMAKE_SIZEOF_VOID_P EQUAL 8)
  set(npsim_x86_64 TRUE)
endif()

# An object library `target`_SET of the same source for each instruction set, with DISPATCH_SET defined as its name.
# `out` becomes the list of names.
function(npsim_add_instruction_sets out target source)
  set(sets only)
  if(npsim_x86_64)
    set(sets sse2 avx2 avx512)
    set(flags_sse2 -march=x86-64)
    set(flags_avx2 -march=x86-64-v3)
    set(flags_avx512 -march=x86-64-v4)
  endif()
  foreach(set IN LISTS sets)
    add_library(${target}_${set} OBJECT "${source}")
    npsim_own_target(${target}_${set})
    target_link_libraries(${target}_${set} PRIVATE npsim::npsim)
    target_include_directories(${target}_${set} PRIVATE "${PROJECT_SOURCE_DIR}/samples")
    target_compile_definitions(${target}_${set} PRIVATE DISPATCH_SET=${set})
    target_compile_options(${target}_${set} PRIVATE ${flags_${set}})  # the last -march counts
  endforeach()
  set(${out} "${sets}" PARENT_SCOPE)
endfunction()

# A program that runs on every machine of the architecture and calls the objects of these sets.
function(npsim_add_dispatcher target source objects)
  add_executable(${target} "${source}")
  npsim_own_target(${target})
  target_include_directories(${target} PRIVATE "${PROJECT_SOURCE_DIR}/samples")
  if(npsim_x86_64)
    target_compile_options(${target} PRIVATE -march=x86-64)
  endif()
  foreach(set IN LISTS ARGN)
    target_sources(${target} PRIVATE $<TARGET_OBJECTS:${objects}_${set}>)
  endforeach()
endfunction()
