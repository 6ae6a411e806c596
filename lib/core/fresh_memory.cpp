#include "core/fresh_memory.hpp"

#include "core/threads.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <new>

namespace tunica {
namespace {

constexpr std::size_t large_page = std::size_t{1} << 21;
constexpr std::size_t small_page = std::size_t{1} << 12;

}  // namespace

void prefer_large_pages(void* begin, std::size_t bytes) {
  // Whole pages inside the range only: the rest may belong to others.
  const auto address = reinterpret_cast<std::uintptr_t>(begin);
  const std::uintptr_t first = (address + large_page - 1) / large_page * large_page;
  const std::uintptr_t last = (address + bytes) / large_page * large_page;
  if (last > first) {
    madvise(static_cast<char*>(begin) + (first - address), last - first, MADV_HUGEPAGE);
  }
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
  void* const memory = std::calloc(std::max<std::size_t>(size, 1), sizeof(T));
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
