#include "tunica/core/fresh_memory.hpp"

#include "tunica/core/threads.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <new>

namespace tunica {
namespace {

constexpr std::size_t large_page = std::size_t{1} << 21;
/// MADV_COLLAPSE of Linux 6.1, which makes a large page of small ones; older systems refuse it.
constexpr int madvise_collapse = 25;
constexpr std::size_t small_page = std::size_t{1} << 12;

}  // namespace

void prefer_large_pages(void* begin, std::size_t bytes) {
  if (bytes < large_page) {
    return;
  }
  const auto address = reinterpret_cast<std::uintptr_t>(begin);
  const std::uintptr_t first = address / large_page * large_page;
  const std::uintptr_t last = (address + bytes + large_page / 2) / large_page * large_page;
  char* const pages = static_cast<char*>(begin) - (address - first);
  madvise(pages, last - first, MADV_HUGEPAGE);
  // In the first one the allocator has written its own words, so the system has begun it with small pages.
  madvise(pages, large_page, madvise_collapse);
}

std::size_t whole_large_pages(std::size_t bytes) {
  if (bytes < 4 * large_page) {
    return bytes;
  }
  // From this size on glibc maps memory for the block alone, which the system aligns to large pages when it is whole
  // ones, with what the allocator adds for itself. Smaller blocks may come from a heap that has small pages already.
  constexpr std::size_t always_mapped = std::size_t{32} << 20;
  constexpr std::size_t allocators_own = 64;
  const std::size_t needed = std::max(bytes, always_mapped) + allocators_own;
  return (needed + large_page - 1) / large_page * large_page - allocators_own;
}

void touch_pages(void* begin, std::size_t bytes) {
  char* const memory = static_cast<char*>(begin);
  parallel_for_blocks(bytes, large_page, [&](std::size_t from, std::size_t to) {
    for (std::size_t at = from; at < to; at += small_page) {
      *const_cast<volatile char*>(memory + at) = 0;
    }
  });
}

template <typename T>
T* ZeroedAllocator<T>::allocate(std::size_t size) {
  void* const memory = std::calloc(std::max<std::size_t>(whole_large_pages(size * sizeof(T)), 1), 1);
  if (memory == nullptr) {
    throw std::bad_alloc();
  }
  prefer_large_pages(memory, size * sizeof(T));
  return static_cast<T*>(memory);
}

template <typename T>
void ZeroedAllocator<T>::deallocate(T* memory, std::size_t) noexcept {
  std::free(memory);
}

template class ZeroedAllocator<std::uint64_t>;

}  // namespace tunica
