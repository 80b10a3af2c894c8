# SPDX-License-Identifier: Apache-2.0
# The library's namespace has another name wherever the compiler may use other instructions, and the same where not.
# Preprocessed only, so that the machine need not have them. In: cxx, processor, include_dir, work_dir.
if(processor MATCHES "^(x86_64|AMD64|amd64)$")
  set(flags -march=x86-64 -march=x86-64-v2 -march=x86-64-v3 -march=x86-64-v4 -march=knl -march=znver1 -march=znver4
      -march=bdver4 -msse3 -mssse3 -msse4.1 -msse4a -mpopcnt -mbmi -mbmi2 -mlzcnt -mmovbe -mavx -mavx2 -mfma
      -mfma4 -mxop -mtbm -mgfni -mavxvnni -mavx512f -mavx512cd -mavx512dq -mavx512bw -mavx512vl -mavx512vbmi
      -mavx512vbmi2 -mavx512vnni -mavx512bitalg -mavx512vpopcntdq -mavx512fp16 -DNPSIM_SIMD_SCALAR)
  set(same "-march=x86-64-v2|-msse4.2" "-march=x86-64|-maes" "-march=x86-64|-mtune=haswell"
      "-march=x86-64-v3|-march=haswell" "-march=x86-64-v4|-march=skylake-avx512")
elseif(processor MATCHES "^(aarch64|arm64)$")
  set(flags -march=armv8-a -march=armv8.1-a -march=armv8.2-a+fp16 -march=armv8.2-a+dotprod -march=armv8.3-a
      -march=armv8.6-a -march=armv8.2-a+sve -march=armv8.2-a+sve2 -DNPSIM_SIMD_SCALAR)
  set(same "-march=armv8-a|-march=armv8-a+aes")
else()
  message("skipped: no flags are known for ${processor}")
  return()
endif()

file(WRITE "${work_dir}/name.cpp" "#include \"npsim/core/config.hpp\"\nNPSIM_ABI\n")
# Empty where the compiler does not know the flag.
function(name_of flag out)
  execute_process(COMMAND "${cxx}" -std=c++17 "${flag}" "-I${include_dir}" -E -P "${work_dir}/name.cpp"
                  RESULT_VARIABLE status OUTPUT_VARIABLE name ERROR_VARIABLE error OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(NOT status EQUAL 0 AND NOT flag MATCHES "^-march=(x86-64|armv8-a)$")
    message(STATUS "${cxx} knows no ${flag}")
    set(name "")
  elseif(NOT name MATCHES "^v[0-9]+_[0-9]+(_[a-z0-9]+)+$")
    message(SEND_ERROR "${flag}: the name is '${name}' ${error}")
  endif()
  set(${out} "${name}" PARENT_SCOPE)
endfunction()

foreach(flag IN LISTS flags)
  name_of("${flag}" name)
  if(NOT name)
    continue()
  endif()
  message(STATUS "${flag} ${name}")
  if(DEFINED flag_of_${name})
    message(SEND_ERROR "${flag} and ${flag_of_${name}} are both ${name}")
  endif()
  set(flag_of_${name} "${flag}")
endforeach()
foreach(pair IN LISTS same)
  string(REPLACE "|" ";" pair "${pair}")
  list(GET pair 0 a)
  list(GET pair 1 b)
  name_of("${a}" name_a)
  name_of("${b}" name_b)
  if(name_b AND NOT name_a STREQUAL name_b)
    message(SEND_ERROR "${a} is ${name_a} and ${b} is ${name_b}, of the same instructions")
  endif()
endforeach()
