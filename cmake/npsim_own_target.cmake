# SPDX-License-Identifier: Apache-2.0
# How our own programs and tests are compiled: warnings, and the instruction set of this machine where the preset
# says so. None of this reaches a user of npsim::npsim.
function(npsim_own_target target)
  target_compile_features(${target} PRIVATE cxx_std_17)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF)
  if(CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
    target_compile_options(${target} PRIVATE
      -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wdouble-promotion)
    if(NPSIM_WARNINGS_AS_ERRORS)
      target_compile_options(${target} PRIVATE -Werror)
    endif()
    if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
      # It reads much and throws little away: to collect garbage seldom saves a tenth of its time.
      target_compile_options(${target} PRIVATE --param=ggc-min-heapsize=600000)  # kB
    endif()
    if(NPSIM_NATIVE AND NOT CMAKE_CROSSCOMPILING)
      target_compile_options(${target} PRIVATE -march=native)
    endif()
  endif()
endfunction()

# For code whose time to compile counts, in place of the build type's level (one core of an AMD EPYC, g++ 12): -O1 with
# what GCC calls expensive takes half of -O3's time, for programs that run 10 % longer; without, they run 50 % longer.
# -Og takes a third. Results are the same bits at every level: floating point is strict.
function(npsim_optimise target level)
  set(options "${level}")
  if(level STREQUAL "-O1" AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
    list(APPEND options -fexpensive-optimizations)
  endif()
  if(CMAKE_CXX_COMPILER_ID MATCHES "GNU|Clang")
    target_compile_options(${target} PRIVATE "$<$<CONFIG:Release,RelWithDebInfo>:${options}>")
  endif()
endfunction()
