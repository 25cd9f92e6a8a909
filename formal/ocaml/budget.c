/* What a check may take of the machine, bytes of memory and seconds of the processor, and what is said where it needs
   more: one line, exit code 2. Where the system has no such limits nothing is limited here. */
#define CAML_INTERNALS
#include <gmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <caml/misc.h>
#include <caml/mlvalues.h>
#ifndef _WIN32
#include <sys/resource.h>
#endif

static char line[200];
static void end(int signal) {
  (void) signal;
  if (write(2, line, strlen(line)) < 0) _exit(3);
  _exit(2);
}
static void fatal(char *message, va_list words) { (void) message; (void) words; end(0); }
static void *had(void *block) { if (block == NULL) end(0); return block; }
static void *take(size_t size) { return had(malloc(size)); }
static void *change(void *block, size_t old, size_t size) { (void) old; return had(realloc(block, size)); }

value ptcc_budget(value bytes, value seconds, value text) {
  snprintf(line, sizeof line, "ptcc-verified: %s\n", String_val(text));
  mp_set_memory_functions(take, change, NULL);
  caml_fatal_error_hook = fatal;
#ifndef _WIN32
  struct rlimit memory = { Long_val(bytes), Long_val(bytes) };
  struct rlimit time = { Long_val(seconds) - 1, Long_val(seconds) }, none = { 0, 0 };
  signal(SIGXCPU, end);
  setrlimit(RLIMIT_AS, &memory);
  setrlimit(RLIMIT_CPU, &time);
  setrlimit(RLIMIT_CORE, &none);
#endif
  return Val_unit;
}
