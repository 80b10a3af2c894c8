# SPDX-License-Identifier: Apache-2.0
# The program that holds all instruction sets makes, with SSE2, the nights that a program of SSE2 alone makes.
# In: together, alone (the two programs).
execute_process(COMMAND "${together}" sse2 OUTPUT_VARIABLE a RESULT_VARIABLE status_a)
execute_process(COMMAND "${alone}" sse2 OUTPUT_VARIABLE b RESULT_VARIABLE status_b)
if(NOT status_a EQUAL 0 OR NOT status_b EQUAL 0 OR NOT a STREQUAL b)
  message(FATAL_ERROR "together: ${status_a} ${a}alone: ${status_b} ${b}")
endif()
