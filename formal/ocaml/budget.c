/* What a check may take of the machine: bytes of memory, and seconds of the processor. Where there are no such limits
   nothing is limited here. */
#include <gmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <caml/mlvalues.h>
#ifndef _WIN32
#include <sys/resource.h>
#endif

static void *had(void *block) {
  if (block == NULL) { fputs("ptcc-verified: takes too much memory\n", stderr); _Exit(2); }
  return block;
}
static void *take(size_t size) { return had(malloc(size)); }
static void *change(void *block, size_t old, size_t size) { (void) old; return had(realloc(block, size)); }

value ptcc_budget(value bytes, value seconds) {
  mp_set_memory_functions(take, change, NULL);
#ifndef _WIN32
  struct rlimit memory = { Long_val(bytes), Long_val(bytes) };
  struct rlimit time = { Long_val(seconds) - 1, Long_val(seconds) }, none = { 0, 0 };
  setrlimit(RLIMIT_AS, &memory);
  setrlimit(RLIMIT_CPU, &time);
  setrlimit(RLIMIT_CORE, &none);
#endif
  return Val_unit;
}
