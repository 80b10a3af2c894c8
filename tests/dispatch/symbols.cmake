# SPDX-License-Identifier: Apache-2.0
# No two of the objects define the same weak symbol: of those the linker would keep one body for all. Two stand in no
# such danger: DW.ref.__gxx_personality_v0 is a pointer, and clang's __clang_call_terminate two calls.
# In: nm, objects (of one instruction set each). With keep, the beginnings of the names of plain C functions, first makes
# of each object one in which these alone are global, as docs/embedding.md advises for builds without optimisation; then
# ld, objcopy and work_dir too.
if(keep)
  set(whole "")
  foreach(object IN LISTS objects)
    list(LENGTH whole i)
    execute_process(COMMAND "${ld}" -r --force-group-allocation "${object}" -o "${work_dir}/whole_${i}.o"
                    COMMAND_ERROR_IS_FATAL ANY)
    execute_process(COMMAND "${objcopy}" --wildcard "--keep-global-symbol=${keep}*" "${work_dir}/whole_${i}.o"
                    COMMAND_ERROR_IS_FATAL ANY)
    list(APPEND whole "${work_dir}/whole_${i}.o")
  endforeach()
  set(objects "${whole}")
endif()

set(shared "")
foreach(object IN LISTS objects)
  execute_process(COMMAND "${nm}" --defined-only "${object}" OUTPUT_VARIABLE lines RESULT_VARIABLE status)
  if(NOT status EQUAL 0)
    message(FATAL_ERROR "${nm} cannot read ${object}")
  endif()
  string(REGEX MATCHALL "[0-9a-f]+ [WVu] [^\n]+" lines "${lines}")
  list(LENGTH lines count)
  message(STATUS "${count} weak symbols in ${object}")
  if(count EQUAL 0 AND NOT keep)
    message(FATAL_ERROR "an object without weak symbols shows nothing")
  endif()
  foreach(line IN LISTS lines)
    string(REGEX REPLACE "^[0-9a-f]+ . " "" symbol "${line}")
    if(symbol MATCHES "^(DW\\.ref\\.__gxx_personality_v0|__clang_call_terminate)$")
      continue()
    endif()
    if(DEFINED "in_${symbol}")
      list(APPEND shared "${symbol}")
    endif()
    set("in_${symbol}" TRUE)
  endforeach()
endforeach()
if(shared)
  list(REMOVE_DUPLICATES shared)
  string(REPLACE ";" "\n" shared "${shared}")
  message(FATAL_ERROR "shared by objects of different instruction sets:\n${shared}")
endif()
