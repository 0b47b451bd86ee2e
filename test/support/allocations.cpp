// Copyright (c) 2026 assembly_cell contributors. BSD-3-Clause, see LICENSE.
#include "allocations.h"

#include <atomic>
#include <cstdlib>
#include <new>

namespace {

std::atomic<std::uint64_t> of_all{0};
thread_local std::uint64_t of_this_thread = 0;

void count() {
  ++of_all;
  ++of_this_thread;
}

}  // namespace

// The address sanitizer has a malloc of its own: operator new alone is counted then.
#if defined(ASSEMBLY_CELL_SANITIZED)
void* operator new(std::size_t size) {
  count();
  if (void* memory = std::malloc(size > 0 ? size : 1)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
#else
// Every allocation of the program calls this, also operator new.
extern "C" void* __libc_malloc(std::size_t);
extern "C" void* __libc_memalign(std::size_t, std::size_t);
extern "C" void* malloc(std::size_t size) {
  count();
  return __libc_malloc(size);
}
extern "C" void* aligned_alloc(std::size_t alignment, std::size_t size) {
  count();
  return __libc_memalign(alignment, size);
}
#endif

namespace assembly_cell::test {

std::uint64_t allocationsOfAll() { return of_all; }
std::uint64_t allocationsOfThisThread() { return of_this_thread; }

}  // namespace assembly_cell::test
